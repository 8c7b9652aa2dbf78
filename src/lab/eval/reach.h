// How soon messages can come through the links of a scenario, if nothing else uses them: for the
// oracle, which may send each message over the best link at the best moment. Pure.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "lab/emu/link.h"
#include "lab/eval/run.h"

namespace interneuron::eval {

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
