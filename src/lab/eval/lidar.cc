#include "lab/eval/lidar.h"

#include <chrono>

namespace interneuron::eval {
namespace {

using std::chrono::microseconds;

struct Measured {
  Duration encode;
  std::vector<VariantProfile> variants;
  // The one with the bytes nearest to a quarter of the first one's.
  std::uint8_t sampled;
  // Run times on the whole sweep, which takes longest, and agreement by variant.
  std::vector<LevelProfile> levels;
  // Agreement of the best level's answer to the whole sweep after 1, 2, 3 sweeps; it is 1 when it
  // is new.
  std::vector<double> aged;
};

// All of this is measured (docs/constants.md, "Point clouds and clusters").
const Measured& measured(LidarSweep sweep) {
  static const Measured kKitti{
      microseconds(3700),
      {{"full", 275'820}, {"10cm", 163'142}, {"20cm", 92'395}, {"40cm", 43'021}},
      2,
      {{microseconds(2400), microseconds(2500), {0.526, 0.527, 0.530, 0.526}},
       {microseconds(4000), microseconds(4200), {0.814, 0.817, 0.814, 0.526}},
       {microseconds(17'800), microseconds(18'200), {1, 0.932, 0.814, 0.526}}},
      {0.048, 0.010, 0.003}};
  static const Measured kNuScenes{
      microseconds(7000),
      {{"full", 418'604}, {"10cm", 289'785}, {"20cm", 204'744}, {"40cm", 128'747}},
      3,
      {{microseconds(8900), microseconds(9600), {0.616, 0.616, 0.617, 0.616}},
       {microseconds(10'600), microseconds(11'700), {0.910, 0.910, 0.910, 0.616}},
       {microseconds(10'700), microseconds(11'600), {1, 0.965, 0.910, 0.616}}},
      {0.022, 0.008, 0.003}};
  return sweep == LidarSweep::kKitti ? kKitti : kNuScenes;
}

}  // namespace

std::string_view to_string(LidarSweep sweep) {
  return sweep == LidarSweep::kKitti ? "kitti" : "nuscenes";
}

Profile lidar_profile(LidarSweep sweep) {
  const Measured& m = measured(sweep);
  return {.variants = m.variants,
          .sampled = m.sampled,
          .level_names = {"40 cm", "20 cm", "all points"},
          .levels = m.levels,
          .fallback = {.local = m.levels.front().quality.front(), .stale_share = m.aged}};
}

Scenario lidar_scenario(LidarSweep sweep) {
  Scenario scenario = table_erdos_scenario();
  scenario.name = std::string("table-lidar ") + std::string(to_string(sweep));
  scenario.profile = lidar_profile(sweep);
  scenario.deadline = scenario.period;
  scenario.hosts.encode = measured(sweep).encode;
  return scenario;
}

}  // namespace interneuron::eval
