#include "lab/files/json_file.h"

#include <fstream>

#include "host/process/failure.h"

namespace interneuron::lab {

void write_json(const std::filesystem::path& file, const Json& json) {
  std::ofstream out(file);
  out << json.dump(2) << '\n';
  out.close();
  if (!out) {
    throw cli::Failure(cli::kFailed, "cannot write '" + file.string() + "'; is the disk full?");
  }
}

Json read_json(const std::filesystem::path& file) {
  std::ifstream in(file);
  Json json = Json::parse(in, nullptr, false);
  if (json.is_discarded()) {
    throw cli::Failure(cli::kFailed, "'" + file.string() + "': not valid JSON");
  }
  return json;
}

}  // namespace interneuron::lab
