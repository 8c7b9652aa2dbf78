// The levels of each ladder, for ladder.cc. Not for other folders: they call make_ladder().
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <vector>

#include "app/perception/detector.h"

namespace interneuron::perception {

// At most `max_levels`, from the lowest. Throws InputError for a missing or bad model.
std::vector<Level> dnn_levels(const std::filesystem::path& data_dir, std::size_t max_levels);

// All share the background models of the streams.
std::vector<Level> motion_levels(std::size_t max_levels);

// With their times. Throws InputError for a missing or bad recording or profile.
std::vector<Level> replay_levels(const std::filesystem::path& data_dir, std::size_t max_levels,
                                 std::function<void(Duration)> spend);

// Sets what was measured of a net on the demo video: Level::quality (profile.csv's where the data
// folder has one), draw_score and recorded_median. Leaves a level of another name alone. Throws
// InputError for a bad profile.
void add_measured(const std::filesystem::path& data_dir, Level& level);

// The models that dnn_levels() reads, and that are not there.
std::vector<std::filesystem::path> missing_models(const std::filesystem::path& data_dir);

}  // namespace interneuron::perception
