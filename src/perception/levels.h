// The levels of each ladder, for ladder.cc. Not for other folders: they call make_ladder().
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string_view>
#include <vector>

#include "perception/detector.h"

namespace interneuron::perception {

// At most `max_levels`, from the lowest. Throws InputError for a missing or bad model.
std::vector<Level> dnn_levels(const std::filesystem::path& data_dir, std::size_t max_levels);

// All share one background model.
std::vector<Level> motion_levels(std::size_t max_levels);

// With their times. Throws InputError for a missing or bad recording or profile.
std::vector<Level> replay_levels(const std::filesystem::path& data_dir, std::size_t max_levels,
                                 std::function<void(Duration)> spend);

// Level::quality of the level of this name. Empty: the data folder has no profile, or not of it.
std::vector<double> recorded_quality(const std::filesystem::path& data_dir, std::string_view name);

// The models that dnn_levels() reads, and that are not there.
std::vector<std::filesystem::path> missing_models(const std::filesystem::path& data_dir);

}  // namespace interneuron::perception
