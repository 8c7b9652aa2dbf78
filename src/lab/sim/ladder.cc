#include "lab/sim/offload.h"

#include <algorithm>
#include <cmath>

namespace interneuron::sim {

std::vector<LevelRuntime> default_ladder() {
  using std::chrono::microseconds;
  return {{"L0", microseconds(7900), microseconds(9800), {0.136, 0.128}},
          {"L2", microseconds(18600), microseconds(23600), {0.348, 0.327}},
          {"L4", microseconds(43900), microseconds(46000), {0.396, 0.383}}};
}

std::vector<LevelRuntime> jpeg_ladder() {
  std::vector<LevelRuntime> ladder = default_ladder();
  ladder[0].quality = {0.139, 0.134, 0.136, 0.133};
  ladder[1].quality = {0.353, 0.348, 0.347, 0.335};
  ladder[2].quality = {0.397, 0.395, 0.394, 0.387};
  return ladder;
}

std::vector<LevelProfile> profiles_of(const std::vector<LevelRuntime>& ladder) {
  std::vector<LevelProfile> out;
  for (const LevelRuntime& level : ladder) {
    out.push_back({level.median, level.p95, level.quality});
  }
  return out;
}

double half_normal_deviations(double unit_normal) {
  constexpr double kMedianOfHalfNormal = 0.67;
  return std::abs(unit_normal) - kMedianOfHalfNormal;
}

Duration runtime_of(Duration median, Duration p95, double deviations) {
  // The 95th percentile of the normal distribution, in standard deviations.
  constexpr double kP95OfNormal = 1.645;
  const double sd = static_cast<double>((p95 - median).count()) / kP95OfNormal;
  const auto middle = static_cast<double>(median.count());
  return Duration{static_cast<std::int64_t>(std::max(middle + deviations * sd, 0.5 * middle))};
}

}  // namespace interneuron::sim
