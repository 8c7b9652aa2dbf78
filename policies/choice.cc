#include "policies/choice.h"

namespace interneuron::policies {

Links fastest(std::span<const LinkState> links, DataRate floor, std::size_t count) {
  return match({.min_rate = floor, .weights = {.delay = 1}, .links = count}, links);
}

Plan send_over(std::span<const LinkState> over, std::uint8_t variant) {
  Plan plan;
  for (const LinkState& link : over) plan.sends.push_back({variant, link.id});
  return plan;
}

Plan over_fastest(const Offer& offer, std::span<const LinkState> links, std::uint8_t variant,
                  std::size_t count) {
  const DataRate floor = rate_floor(offer.qos, offer.variant_bytes[variant]);
  Links carriers = fastest(links, floor, count);
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
