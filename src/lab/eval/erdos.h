// The honest baseline after ERDOS (docs/paper.md, "The baseline after ERDOS"): the end-to-end
// deadline is decomposed once into a deadline of the computation, and each computation takes the
// best level that its worst times let end by then. Pure.
#pragma once

#include <span>
#include <vector>

#include "lab/sim/offload.h"

namespace interneuron::eval {

// What is measured before the run and then frozen.
struct ErdosTimes {
  // T1: the median time from t0 to the hand-over of the best variant.
  Duration uplink{};
  // T3: the median time from the end of the computation to the answer.
  Duration downlink{};
  // R: the 99th percentile of the run time, by level.
  std::vector<Duration> runtime;
};
// The undisturbed rounds that are measured.
inline constexpr std::uint32_t kErdosRounds = 100;

// R of these levels, by their measured quantiles.
std::vector<Duration> erdos_runtimes(std::span<const LevelProfile> levels);

// Measures undisturbed rounds on the links of `options`, at the highest level.
ErdosTimes erdos_times(sim::OffloadOptions options);

// The level that step 6 of the baseline takes, as OffloadOptions::level_rule. `end_to_end`: the
// erdos_e2e of the ladder, which knows t0 by clocks in perfect step, instead of counting from the
// hand-over.
sim::LevelRule erdos_rule(ErdosTimes times, Duration deadline, bool end_to_end);

}  // namespace interneuron::eval
