// What the best possible system would have reached on the same trace. Pure.
//
// oracle() and causal() judge each round by itself: messages of different rounds do not queue
// behind each other, nothing is lost, and a variant goes whole over one link. So both figures are
// upper bounds: no system that does not stripe can do better, and perhaps none can do as well.
// causal_player() is no bound, but what knowledge of the law reaches where rounds do get into each
// other's way.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "lab/eval/run.h"

namespace interneuron::eval {

// What a miss costs, in units of quality, as for the guard `budget` by default.
inline constexpr double kMissPrice = BudgetOptions{}.miss_price;

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

// Whether causal() and causal_player() know the law of a scenario: constant links, and delays that
// meet every link and module alike.
bool is_known_to_causal(const Scenario& scenario);

// Knows the law and all of the rounds before, not the future. It takes the variant and the link
// with the highest expected quality at the start, and the level when the computation begins; a miss
// costs `miss_price`, in units of quality. It bounds what can be expected of quality - miss_price *
// timeouts, not what one trace gives. Empty where the law is not known.
std::optional<Bound> causal(const Scenario& scenario, const Trace& trace,
                            double miss_price = kMissPrice);

// What causal() knows, played over the endpoints, links and the one core of the systems, so that
// what one round holds up carries over to the next. One variant for all rounds, which goes over
// every link, and for each computation the level of the highest expected value.
struct Player {
  std::uint8_t variant = 0;
  // Refers to the scenario and the trace.
  sim::LevelRule level;
};
// Empty where causal() is.
std::optional<Player> causal_player(const Scenario& scenario, const Trace& trace,
                                    double miss_price = kMissPrice);

}  // namespace interneuron::eval
