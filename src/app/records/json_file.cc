#include "app/records/json_file.h"

#include "app/process/failure.h"
#include "app/process/whole_file.h"

namespace interneuron::records {

void write_json(const std::filesystem::path& file, const Json& json) {
  process::write_whole(file, json.dump(2) + '\n');
}

Json read_json(const std::filesystem::path& file) {
  Json json = Json::parse(process::read_whole(file, process::kFailed), nullptr, false);
  if (json.is_discarded()) {
    throw process::Failure(process::kFailed, "'" + file.string() + "': not valid JSON");
  }
  return json;
}

}  // namespace interneuron::records
