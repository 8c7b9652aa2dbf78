#include "core/plan/plan_message.h"

#include <algorithm>

namespace interneuron {
namespace {

bool is_small_result(const Offer& offer) {
  return offer.qos.message_class == MessageClass::kResult &&
         offer.variant_bytes.front() <= kSmallResultBytes;
}

Plan over_every_link(const Policy& policy, std::span<const LinkState> links) {
  Plan plan;
  for (const LinkState& link : links) {
    if (link.up && policy.allows(link)) plan.sends.push_back({.variant = 0, .link = link.id});
  }
  return plan;
}

bool can_be_sent(const Policy& policy, const Assignment& send, const Offer& offer,
                 std::span<const LinkState> links) {
  return send.variant < offer.variant_bytes.size() &&
         std::ranges::any_of(links, [&](const LinkState& link) {
           return link.up && link.id == send.link && policy.allows(link);
         });
}

}  // namespace

Plan plan_message(const Policy& policy, const Offer& offer, std::span<const LinkState> links,
                  const Guidance& guidance) {
  if (offer.variant_bytes.empty() || std::ranges::none_of(links, &LinkState::up)) return {};
  if (is_small_result(offer)) {
    Plan everywhere = over_every_link(policy, links);
    if (!everywhere.sends.empty()) return everywhere;
    // The policy allows none of the links; its plan() says why.
  }

  const Plan answer = policy.plan(offer, links, guidance);
  Plan plan;
  for (const Assignment& send : answer.sends) {
    const bool repeated = std::ranges::find(plan.sends, send) != plan.sends.end();
    if (!repeated && can_be_sent(policy, send, offer, links)) plan.sends.push_back(send);
  }
  plan.under_floor = answer.under_floor && !plan.sends.empty();
  if (plan.sends.empty()) plan.refused = answer.refused;
  if (answer.sends.empty() && plan.refused.empty()) plan.refused = kNothingPlanned;
  return plan;
}

}  // namespace interneuron
