#include "lab/eval/erdos.h"

#include <algorithm>

#include "core/base/statistics.h"

namespace interneuron::eval {
namespace {

// The 99th percentile of a half-normal, in standard deviations of the normal.
constexpr double kP99OfHalfNormal = 2.576;

}  // namespace

ErdosTimes erdos_times(sim::OffloadOptions options) {
  options.rounds = kErdosRounds;
  options.disturbances.clear();
  options.road_step.reset();
  options.level_rule = nullptr;
  options.top_level = options.ladder.size() - 1;
  std::vector<double> uplink;
  std::vector<double> downlink;
  for (const sim::OffloadRound& round : sim::run_offload(options).rounds) {
    if (!round.at_road) continue;
    uplink.push_back(to_ms(round.at_road->delivered - round.t0));
    if (round.at_road->ended && round.done.outcome == Outcome::kRemote) {
      downlink.push_back(to_ms(round.t0 + round.done.e2e - *round.at_road->ended));
    }
  }
  std::vector<LevelProfile> levels;
  for (const sim::LevelRuntime& level : options.ladder) {
    levels.push_back({level.median, level.p95, {}});
  }
  return {from_ms(percentile(uplink, 0.5)), from_ms(percentile(downlink, 0.5)),
          erdos_runtimes(levels)};
}

std::vector<Duration> erdos_runtimes(std::span<const LevelProfile> levels) {
  const double worst = sim::half_normal_deviations(kP99OfHalfNormal);
  std::vector<Duration> out;
  for (const LevelProfile& level : levels) {
    out.push_back(sim::runtime_of(level.median, level.p95, worst));
  }
  return out;
}

sim::LevelRule erdos_rule(ErdosTimes times, Duration deadline, bool end_to_end) {
  return [times = std::move(times), deadline, end_to_end](std::uint32_t, Duration delivered,
                                                          Duration began) {
    const Duration spent = end_to_end ? began : times.uplink + (began - delivered);
    const Duration left = deadline - times.downlink - spent;
    std::size_t level = 0;
    for (std::size_t i = 0; i < times.runtime.size(); ++i) {
      if (times.runtime[i] <= left) level = i;
    }
    return level;
  };
}

}  // namespace interneuron::eval
