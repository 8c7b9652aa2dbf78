// JSON as files hold it.
#pragma once

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

namespace interneuron::records {

// Keys keep the order in which they were written, for people who read the files.
using Json = nlohmann::ordered_json;

// A figure as files and tables tell it: to a thousandth, or to one part of `scale`.
inline double rounded(double value, double scale = 1e3) {
  return std::round(value * scale) / scale;
}

// Both throw process::Failure (1) that names the file: when it cannot be written or read, and when
// it holds no JSON. A file is written whole or not at all.
void write_json(const std::filesystem::path& file, const Json& json);
Json read_json(const std::filesystem::path& file);

}  // namespace interneuron::records
