#include "policies/choice.h"

namespace interneuron::policies {

Links fastest(std::span<const LinkState> links, DataRate floor, std::size_t count) {
  return match({.min_rate = floor, .weights = {.delay = 1}, .links = count}, links);
}

Links soonest(std::span<const LinkState> links, DataRate floor, std::size_t count,
              std::size_t bytes) {
  Links ranked;
  // By insertion, which keeps the order of equals.
  for (const LinkState& link : fastest(links, floor, kAllLinks)) {
    const auto sooner_than = [&](const LinkState& other) {
      return link.traits.priority == other.traits.priority &&
             arrival_time(link, bytes) < arrival_time(other, bytes);
    };
    std::size_t at = ranked.size();
    while (at > 0 && sooner_than(ranked[at - 1])) --at;
    ranked.insert(at, link);
  }
  Links out;
  for (const LinkState& link : ranked) {
    if (out.size() < count) out.push_back(link);
  }
  return out;
}

Plan send_over(std::span<const LinkState> over, std::uint8_t variant) {
  Plan plan;
  for (const LinkState& link : over) plan.sends.push_back({variant, link.id});
  return plan;
}

Plan over_fastest(const Offer& offer, std::span<const LinkState> links, std::uint8_t variant,
                  std::size_t count) {
  const DataRate floor = rate_floor(offer.qos, offer.variant_bytes[variant]);
  Links carriers = soonest(links, floor, count, offer.variant_bytes[variant]);
  const bool none_can = carriers.empty();
  if (none_can) carriers = fastest(links, {}, count);
  Plan plan = send_over(carriers, variant);
  plan.under_floor = none_can && !carriers.empty();
  return plan;
}

std::uint8_t smallest_variant(const Offer& offer) {
  return static_cast<std::uint8_t>(offer.variant_bytes.size() - 1);
}

Merge hold_for_better(const Arrival& arrival) {
  const bool better_may_come = arrival.best_planned < arrival.variant && !arrival.degraded;
  return better_may_come ? Merge::kHold : Merge::kDeliver;
}

}  // namespace interneuron::policies
