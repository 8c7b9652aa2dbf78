#include "app/records/json_file.h"

#include "app/process/failure.h"
#include "app/process/whole_file.h"

namespace interneuron::lab {

void write_json(const std::filesystem::path& file, const Json& json) {
  cli::write_whole(file, json.dump(2) + '\n');
}

Json read_json(const std::filesystem::path& file) {
  Json json = Json::parse(cli::read_whole(file, cli::kFailed), nullptr, false);
  if (json.is_discarded()) {
    throw cli::Failure(cli::kFailed, "'" + file.string() + "': not valid JSON");
  }
  return json;
}

}  // namespace interneuron::lab
