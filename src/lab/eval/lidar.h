// The offloaded lidar pipeline: a sweep per round, sent whole or thinned to voxels, in which the
// roadside finds clusters. What answers are worth is agreement with what the best level finds on
// the whole sweep, not accuracy: nobody has labelled the sweeps. Pure.
#pragma once

#include <cstdint>
#include <string_view>

#include "lab/eval/quality.h"
#include "lab/eval/run.h"

namespace interneuron::eval {

// Which recorded sweep is moved (perception::MovedSweeps).
enum class LidarSweep : std::uint8_t {
  // 64 rings, cut to what a camera sees.
  kKitti,
  // 32 rings, all around.
  kNuScenes,
};
// "kitti" or "nuscenes".
std::string_view to_string(LidarSweep sweep);

// Sizes, run times and agreements as measured (docs/constants.md, "Point clouds and clusters"):
// variants as perception::cloud_rungs(), levels as perception::cluster_levels().
Profile lidar_profile(LidarSweep sweep);

// The links and the law of table_erdos_scenario(). The deadline is the period of the sweeps, so
// that an answer is there before the next sweep is.
Scenario lidar_scenario(LidarSweep sweep);

}  // namespace interneuron::eval
