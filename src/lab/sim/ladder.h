// The levels of the simulated computation and how long a run at each of them takes: what stands in
// for a detector in virtual time. Pure functions.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

#include "interneuron/guard.h"

namespace interneuron::sim {

struct LevelRuntime {
  std::string name;
  Duration median{};
  Duration p95{};
  // As LevelProfile::quality.
  std::vector<double> quality{};
};

// Three levels of one detector on one thread, from the lightest to the best. The quality is the
// average precision measured on raw and on sampled images (docs/constants.md, "Images and
// detectors").
std::vector<LevelRuntime> default_ladder();
// The same levels on the JPEGs of the codec (`--images jpeg`), with the mean bytes of each rung on
// the demo video and what it takes to make all of them.
std::vector<LevelRuntime> jpeg_ladder();
inline constexpr std::array<std::size_t, 4> kJpegBytes{45'600, 24'800, 15'800, 10'000};
inline constexpr Duration kJpegEncode = std::chrono::microseconds(5000);
// The same as an endpoint takes it.
std::vector<LevelProfile> profiles_of(const std::vector<LevelRuntime>& ladder);

// Run times are half-normal: half of them are above the median, and these lie further away from it
// than the others. How slow a run is counts in standard deviations of its level from the level's
// median, so that the same figure makes a run as slow at one level as at another.
//
// That figure for a run, `unit_normal` being drawn from the standard normal distribution.
double half_normal_deviations(double unit_normal);
// The run time at a level with this median and 95th percentile; never less than half the median.
Duration runtime_of(Duration median, Duration p95, double deviations);

}  // namespace interneuron::sim
