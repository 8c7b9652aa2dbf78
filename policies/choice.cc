#include "policies/choice.h"

namespace interneuron::policies {

Links fastest(std::span<const LinkState> links, DataRate floor, std::size_t count) {
  return match({.min_rate = floor, .weights = {.delay = 1}, .links = count}, links);
}

Plan send_over(std::span<const LinkState> chosen, std::uint8_t variant) {
  Plan plan;
  for (const LinkState& link : chosen) plan.sends.push_back({variant, link.id});
  return plan;
}

Plan over_fastest(const Offer& offer, std::span<const LinkState> links, std::uint8_t variant,
                  std::size_t count) {
  const DataRate floor = rate_floor(offer.qos, offer.variant_bytes[variant]);
  Links chosen = fastest(links, floor, count);
  const bool none_can = chosen.empty();
  if (none_can) chosen = fastest(links, {}, count);
  Plan plan = send_over(chosen, variant);
  plan.under_floor = none_can && !chosen.empty();
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
