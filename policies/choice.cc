#include "policies/choice.h"

#include <algorithm>

namespace interneuron::policies {

Links fastest(std::span<const LinkState> links, DataRate floor, std::size_t count) {
  return match({.min_rate = floor, .weights = {.delay = 1}, .links = count}, links);
}

Links soonest(std::span<const LinkState> links, DataRate floor, std::size_t count,
              std::size_t bytes) {
  return ranked(fastest(links, floor, kAllLinks), count,
                [bytes](const LinkState& link) { return arrival_time(link, bytes); });
}

Links smallest_round_trips(std::span<const LinkState> links, std::size_t count) {
  return ranked(links, count, [](const LinkState& link) {
    return link.rtt_p50 == Duration::zero() ? Duration::max() : link.rtt_p50;
  });
}

namespace {

// Whether a link may carry what is not certain to be needed.
bool is_spare(const LinkState& link) {
  return link.traits.role == LinkRole::kNormal && !link.traits.metered;
}

bool carries(const Plan& plan, LinkId link) {
  return std::ranges::find(plan.sends, link, &Assignment::link) != plan.sends.end();
}

}  // namespace

void add_shadows(Plan& plan, const Offer& offer, std::span<const LinkState> links) {
  if (plan.sends.empty()) return;
  const Plan sets_out = plan;
  const std::uint8_t best = plan.sends.front().variant;
  const bool divided = plan.sends.front().role == SendRole::kShare;
  const std::size_t end = std::min<std::size_t>(offer.variant_bytes.size(), best + 2U);
  for (std::size_t v = best; v < end; ++v) {
    for (const LinkState& link : soonest(links, {}, kAllLinks, offer.variant_bytes[v])) {
      if (!is_spare(link) || (!divided && carries(sets_out, link.id))) continue;
      plan.sends.push_back({static_cast<std::uint8_t>(v), link.id, SendRole::kShadow});
    }
  }
}

void add_parity(Plan& plan, std::span<const LinkState> links) {
  if (plan.sends.empty()) return;
  const Plan sets_out = plan;
  const std::uint8_t best = plan.sends.front().variant;
  for (const LinkState& link : fastest(links, {}, kAllLinks)) {
    if (is_spare(link) || carries(sets_out, link.id)) {
      plan.sends.push_back({best, link.id, SendRole::kParity});
    }
  }
}

void report_floor(Plan& plan, const Offer& offer, std::span<const LinkState> links) {
  if (plan.sends.empty()) return;
  const DataRate floor = rate_floor(offer.qos, offer.variant_bytes[plan.sends.front().variant]);
  DataRate shares{};
  bool met = false;
  for (const Assignment& send : plan.sends) {
    const LinkState& link = *std::ranges::find(links, send.link, &LinkState::id);
    const bool measured = link.rate > DataRate{};
    if (send.role == SendRole::kShare) shares.bits_per_second += link.usable_rate().bits_per_second;
    const bool carries_it = send.role == SendRole::kWhole && link.usable_rate() >= floor;
    met = met || carries_it || (!measured && send.role <= SendRole::kShare);
  }
  plan.under_floor = !met && shares < floor;
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

std::uint8_t best_variant(const Offer& offer, const Guidance& guidance) {
  const std::uint8_t smallest = smallest_variant(offer);
  return guidance.degraded ? smallest : std::min(guidance.variant.value_or(0), smallest);
}

Merge hold_for_better(const Arrival& arrival) {
  const bool better_may_come = arrival.best_planned < arrival.variant && !arrival.degraded;
  return better_may_come ? Merge::kHold : Merge::kDeliver;
}

}  // namespace interneuron::policies
