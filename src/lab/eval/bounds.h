// What the best possible system would have reached on the same trace. Pure.
//
// Each round is judged by itself: messages of different rounds do not queue behind each other,
// nothing is lost, and a variant goes whole over one link. So both figures are upper bounds: no
// system can do better, and perhaps none can do as well.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "lab/eval/run.h"

namespace interneuron::eval {

struct Bound {
  std::uint32_t timeouts = 0;
  // The mean per round.
  double quality = 0;
  // What the application gets, by round.
  std::vector<Shown> shown;
};

// Knows every delay beforehand: reaches the fewest timeouts and, given those, the highest sum of
// quality over all choices of variant, link and level. `seed` is that of run().
Bound oracle(const Scenario& scenario, const Trace& trace, std::uint64_t seed);

// Knows the law and all of the rounds before, not the future. It takes the variant and the link
// with the highest expected quality at the start, and the level when the computation begins; a miss
// costs `miss_price`, in units of quality. It bounds what can be expected of quality - miss_price *
// timeouts, not what one trace gives. Empty for links that are not constant.
std::optional<Bound> causal(const Scenario& scenario, const Trace& trace,
                            double miss_price = BudgetOptions{}.miss_price);

}  // namespace interneuron::eval
