#include "lab/eval/bounds.h"

#include <algorithm>

#include "lab/sim/feasibility.h"

namespace interneuron::eval {
namespace {

emu::Bottleneck bottleneck_of(const emu::DirectionParams& params) {
  return params.trace ? emu::Bottleneck(*params.trace) : emu::Bottleneck(params.rate);
}

}  // namespace

Reach::Reach(const Scenario& scenario, std::uint64_t seed) {
  // Fresh processes of the run's seeds.
  for (std::size_t i = 0; i < scenario.links.size(); ++i) {
    const emu::LinkProfile& link = scenario.links[i];
    links_.push_back({emu::Link(link, emu::link_seed(seed, i)), bottleneck_of(link.up),
                      bottleneck_of(link.down)});
  }
}

Duration Reach::over(OneLink& link, emu::Direction direction, Duration ready,
                     std::size_t ip_bytes) {
  emu::Bottleneck& bottleneck = direction == emu::Direction::kUp ? link.up : link.down;
  Duration departure = bottleneck.departure(ready, ip_bytes);
  // The delay holds from step to step; a later departure may meet a smaller one.
  Duration best = Duration::max();
  while (departure < best) {
    best = std::min(best, departure + link.model.process()->at(departure).rtt / 2);
    departure += emu::kDelayStep - departure % emu::kDelayStep;
  }
  return best;
}

Duration Reach::soonest(emu::Direction direction, Duration ready, std::size_t bytes,
                        const std::function<Duration(std::size_t)>& delay) {
  Duration best = Duration::max();
  for (std::size_t i = 0; i < links_.size(); ++i) {
    const Duration there = over(links_[i], direction, ready, sim::bytes_on_wire(bytes));
    if (there == Duration::max()) continue;
    best = std::min(best, there + (delay ? delay(i) : Duration{}));
  }
  return best;
}

bool has_constant_links(const Scenario& scenario) {
  return std::ranges::all_of(scenario.links, [](const emu::LinkProfile& link) {
    return link.delay.trace == nullptr && link.delay.min_ms == link.delay.max_ms &&
           !link.up.trace && !link.down.trace;
  });
}

}  // namespace interneuron::eval
