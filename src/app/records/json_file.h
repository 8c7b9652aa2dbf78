// JSON as files hold it.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

namespace interneuron::lab {

// Keys keep the order in which they were written, for people who read the files.
using Json = nlohmann::ordered_json;

// Both throw cli::Failure (1) that names the file: when it cannot be written or read, and when it
// holds no JSON. A file is written whole or not at all.
void write_json(const std::filesystem::path& file, const Json& json);
Json read_json(const std::filesystem::path& file);

}  // namespace interneuron::lab
