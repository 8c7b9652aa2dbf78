// What several tests of this folder need.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "app/perception/codec.h"
#include "app/perception/input_error.h"
#include "tests/places.h"

namespace interneuron::perception {

// The folder with the demo's data: the environment's INTERNEURON_DATA, else one beside the source
// tree.
inline std::optional<std::filesystem::path> data_dir() {
  const char* named = std::getenv("INTERNEURON_DATA");
  const std::filesystem::path dir =
      named != nullptr ? std::filesystem::path(named)
                       : std::filesystem::path(places::source()) / "../shared/data";
  std::error_code error;
  if (!std::filesystem::is_directory(dir, error)) return {};
  return dir;
}

// For tests that measure with real data: whether one of these files is not there, so that the test
// is skipped and has to return.
inline bool skips_without(std::initializer_list<std::string_view> files) {
  const auto dir = data_dir();
  for (const std::string_view file : files) {
    if (dir && std::filesystem::exists(*dir / file)) continue;
    [file] {
      GTEST_SKIP() << "no " << file
                   << ": set INTERNEURON_DATA to a folder that has it (see scripts/fetch_data.sh)";
    }();
    return true;
  }
  return false;
}

// A folder of its own, gone afterwards.
class TempDir {
 public:
  TempDir() {
    std::string name = (std::filesystem::temp_directory_path() / "perception.XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("mkdtemp failed");
    path_ = name;
  }
  ~TempDir() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

inline void write_text(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << text;
}

// A still, textured scene of 768 x 576, the same each time.
inline cv::Mat scene(std::uint64_t seed = 1) {
  cv::Mat coarse(36, 48, CV_8UC3);
  cv::RNG rng(seed);
  rng.fill(coarse, cv::RNG::UNIFORM, 90, 170);
  cv::Mat scene;
  cv::resize(coarse, scene, {768, 576}, 0, 0, cv::INTER_CUBIC);
  return scene;
}

// What `action` says it cannot use, or "" if it does not complain.
template <class Action>
std::string complaint(Action action) {
  try {
    action();
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

}  // namespace interneuron::perception
