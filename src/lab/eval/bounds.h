// What the best possible system would have reached on the same trace. Pure.
//
// Each round by itself (no queueing between rounds, no losses, a variant whole over one link), so
// both are upper bounds: no system can do better, whether any could do as well is not said.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "lab/eval/run.h"

namespace interneuron::eval {

struct Bound {
  std::uint32_t timeouts = 0;
  double quality = 0;  // mean per round
  std::vector<Shown> shown;
};

// Knows every delay beforehand: the fewest timeouts and, given those, the highest sum of quality
// over variants × links × levels. `seed`: as run()'s.
Bound oracle(const Scenario& scenario, const Trace& trace, std::uint64_t seed);

// Knows the law and the past (all of the round before), not the future: expected-quality-optimal
// choice of variant and link at the start, of the level when the computation begins, a miss costing
// `miss_price`. Only for constant links; nothing for others. A bound of what is expected of
// quality - miss_price * timeouts, not of each trace.
std::optional<Bound> causal(const Scenario& scenario, const Trace& trace,
                            double miss_price = BudgetOptions{}.miss_price);

}  // namespace interneuron::eval
