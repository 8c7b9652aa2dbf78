// Finds the folder of videos, models and ground truth. Looks at the file system and the
// environment; thread-safe as long as nobody changes the environment. Errors: Failure.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace interneuron::settings {

// `given`, else $INTERNEURON_DATA, else the first that exists of ../shared/data and build/data
// beside the working directory, else nothing. Throws Failure(3) when a folder that was named does
// not exist.
std::optional<std::filesystem::path> find_data(const std::string& given);

// The demo's video in the data folder, or Debian's copy in opencv-doc. Throws Failure(3) when there
// is none.
std::string default_video(const std::optional<std::filesystem::path>& data);

// The ground truth of that video, if it is there.
std::optional<std::filesystem::path> default_truth(
    const std::optional<std::filesystem::path>& data);

}  // namespace interneuron::settings
