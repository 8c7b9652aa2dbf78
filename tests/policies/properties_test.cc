// What holds for every built-in policy, whatever the links, the message and the guidance.
#include "policies/builtin.h"
#include "tests/policies/any.h"

namespace interneuron::policy_test::properties_test {
namespace {

RC_GTEST_PROP(PolicyProperty, PlansOnlyWhatCanBeSent, ()) {
  const auto links = any_links();
  const AnyMessage message;
  for (const auto& policy : builtin_policies()) {
    const Plan plan = policy->plan(message.offer(), links, message.guidance);
    std::set<std::tuple<std::uint8_t, LinkId, SendRole>> seen;
    for (const Assignment& send : plan.sends) {
      RC_ASSERT(send.variant < message.variant_bytes.size());
      const auto link = std::ranges::find(links, send.link, &LinkState::id);
      RC_ASSERT(link != links.end());
      RC_ASSERT(link->up);
      RC_ASSERT(seen.emplace(send.variant, send.link, send.role).second);
    }
  }
}

RC_GTEST_PROP(PolicyProperty, SendsSomethingOrSaysWhyNotExactlyWhenALinkIsUp, ()) {
  const auto links = any_links();
  const AnyMessage message;
  for (const auto& policy : builtin_policies()) {
    const Plan plan = policy->plan(message.offer(), links, message.guidance);
    const bool answered = !plan.sends.empty() || !plan.refused.empty();
    RC_ASSERT(answered == std::ranges::any_of(links, &LinkState::up));
    RC_ASSERT(plan.sends.empty() || plan.refused.empty());
    RC_ASSERT(!(plan.sends.empty() && plan.under_floor));
  }
}

// Unless it is reported, each link can carry what it is given, as far as is known.
RC_GTEST_PROP(PolicyProperty, MeetsTheFloorOrReports, ()) {
  const auto links = any_links();
  const AnyMessage message;
  for (const auto& policy : builtin_policies()) {
    const Plan plan = policy->plan(message.offer(), links, message.guidance);
    if (plan.under_floor) continue;
    // Shares, together.
    std::map<std::uint8_t, std::int64_t> shares;
    bool all_measured = true;
    for (const Assignment& send : plan.sends) {
      const auto link = std::ranges::find(links, send.link, &LinkState::id);
      const DataRate floor = rate_floor(message.qos, message.variant_bytes[send.variant]);
      if (send.role == SendRole::kWhole) {
        RC_ASSERT(link->rate == DataRate{} || link->rate >= floor);
      } else if (send.role == SendRole::kShare) {
        shares[send.variant] += link->rate.bits_per_second;
        all_measured = all_measured && link->rate > DataRate{};
      }
    }
    for (const auto& [variant, sum] : shares) {
      const DataRate floor = rate_floor(message.qos, message.variant_bytes[variant]);
      RC_ASSERT(!all_measured || sum >= floor.bits_per_second);
    }
  }
}

// The best variant that was planned is never held; degraded, nothing is. So a message is always
// delivered.
RC_GTEST_PROP(PolicyProperty, HoldsOnlyWhatABetterPlannedVariantMayReplace, ()) {
  const auto links = any_links();
  const AnyMessage message;
  for (const auto& policy : builtin_policies()) {
    const Plan plan = policy->plan(message.offer(), links, message.guidance);
    if (plan.sends.empty()) continue;
    const auto best = std::ranges::min(plan.sends, {}, &Assignment::variant).variant;
    for (const Assignment& send : plan.sends) {
      const Merge merge = policy->merge({send.variant, best, message.guidance.degraded});
      if (send.variant == best || message.guidance.degraded) RC_ASSERT(merge == Merge::kDeliver);
    }
  }
}

// This holds for the policies that rank links; the others weigh times against the deadline. The
// links that are measured carry a message equally fast here: where they do not, its size counts
// beside the delays.
RC_GTEST_PROP(PolicyProperty, ScalingAllDelaysChangesNothing, (bool larger)) {
  auto links = any_links();
  const DataRate rate{*rc::gen::inRange<std::int64_t>(1, 200'000'000)};
  for (LinkState& link : links) {
    if (link.rate > DataRate{}) link.rate = rate;
  }
  link::score(links);
  AnyMessage message;
  message.guidance.time_left = Duration::max();
  std::vector<LinkState> scaled = links;
  const int factor = *rc::gen::inRange(2, larger ? 1000 : 4);
  for (LinkState& link : scaled) link.rtt_p95 *= factor;
  link::score(scaled);
  const std::set<std::string_view> weighing{"joint", "placement", "split"};
  for (const auto& policy : builtin_policies()) {
    if (weighing.contains(policy->name())) continue;
    const Plan a = policy->plan(message.offer(), links, message.guidance);
    const Plan b = policy->plan(message.offer(), scaled, message.guidance);
    RC_ASSERT(a.sends == b.sends);
    RC_ASSERT(a.under_floor == b.under_floor);
  }
}

// Among the links that can carry the message, best_link takes the one that brings it soonest.
RC_GTEST_PROP(PolicyProperty, BestLinkTakesTheSoonestOfTheLinksThatCanCarryIt, ()) {
  const auto links = any_links();
  const AnyMessage message;
  const Plan plan = policies::best_link()->plan(message.offer(), links, message.guidance);
  if (plan.sends.empty() || plan.under_floor) return;
  const Assignment sent = plan.sends.front();
  const std::size_t bytes = message.variant_bytes[sent.variant];
  const LinkState& chosen = link_of(links, sent.link);
  for (const LinkState& link : links) {
    const bool can =
        link.up && (link.rate == DataRate{} || link.rate >= rate_floor(message.qos, bytes));
    if (can) RC_ASSERT(arrival_time(chosen, bytes) <= arrival_time(link, bytes));
  }
}

RC_GTEST_PROP(PolicyProperty, TheSameArgumentsGiveTheSameAnswer, ()) {
  const auto links = any_links();
  const AnyMessage message;
  for (const auto& policy : builtin_policies()) {
    const Plan a = policy->plan(message.offer(), links, message.guidance);
    const Plan b = policy->plan(message.offer(), links, message.guidance);
    RC_ASSERT(a.sends == b.sends);
    RC_ASSERT(a.under_floor == b.under_floor);
    RC_ASSERT(a.refused == b.refused);
  }
}

}  // namespace
}  // namespace interneuron::policy_test::properties_test
