// What the best possible system would have reached on the same trace. Pure.
//
// oracle() and causal() judge each round by itself: messages of different rounds do not queue
// behind each other, nothing is lost, and a variant goes whole over one link. So both figures are
// upper bounds: no system that does not stripe can do better, and perhaps none can do as well.
// causal_player() is no bound, but what knowledge of the law reaches where rounds do get into each
// other's way.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "lab/emu/link.h"
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

// How soon messages can come through the links of a scenario, if nothing else uses them: for the
// oracle, which may send each message over the best link at the best moment. Pure.
class Reach {
 public:
  Reach(const Scenario& scenario, std::uint64_t seed);

  // The soonest arrival, over the best link, of a message that can be sent from `ready` on; it may
  // wait for a better moment. Duration::max() when it never arrives. `ready` is world time, and
  // goes back by at most DelayProcess::kMemory between calls. `delay`: how much longer it takes
  // over each link.
  Duration soonest(emu::Direction direction, Duration ready, std::size_t bytes,
                   const std::function<Duration(std::size_t link)>& delay = nullptr);

 private:
  struct OneLink {
    emu::Link model;
    emu::Bottleneck up;
    emu::Bottleneck down;
  };
  static Duration over(OneLink& link, emu::Direction direction, Duration ready,
                       std::size_t ip_bytes);

  std::vector<OneLink> links_;
};

// Whether every round on these links takes the same times.
bool has_constant_links(const Scenario& scenario);

}  // namespace interneuron::eval
