// What holds for every built-in policy, whatever the links, the message and the guidance.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <set>

#include "interneuron/policy.h"
#include "link/nature.h"

namespace interneuron {
namespace {

std::vector<LinkState> any_links() {
  const auto count = *rc::gen::inRange<std::uint8_t>(0, 6);
  std::vector<LinkState> links;
  for (std::uint8_t i = 0; i < count; ++i) {
    LinkState link;
    link.id = LinkId{static_cast<std::uint8_t>(200 - 7 * i)};
    link.up = *rc::gen::inRange(0, 4) > 0;
    link.rtt_p95 = Duration{*rc::gen::oneOf(rc::gen::just<std::int64_t>(0),
                                            rc::gen::inRange<std::int64_t>(1, 1'000'000'000))};
    link.rate = DataRate{*rc::gen::oneOf(rc::gen::just<std::int64_t>(0),
                                         rc::gen::inRange<std::int64_t>(1, 200'000'000))};
    link.loss = 1e-5 * *rc::gen::inRange(0, 100'000);
    links.push_back(link);
  }
  link::score(links);
  return links;
}

struct AnyOffer {
  QoS qos;
  std::vector<std::size_t> variant_bytes;
  Guidance guidance;

  AnyOffer() {
    qos.deadline = std::chrono::milliseconds(*rc::gen::inRange(1, 500));
    qos.period = std::chrono::milliseconds(*rc::gen::inRange(0, 200));
    const auto count = *rc::gen::inRange<std::size_t>(1, kMaxVariants + 1);
    for (std::size_t i = 0; i < count; ++i) {
      variant_bytes.push_back(*rc::gen::inRange<std::size_t>(0, 1'000'000));
    }
    std::ranges::sort(variant_bytes, std::greater{});
    guidance.degraded = *rc::gen::arbitrary<bool>();
  }
  Offer offer() const { return {qos, variant_bytes}; }
};

RC_GTEST_PROP(PolicyProperty, PlansOnlyWhatCanBeSent, ()) {
  const auto links = any_links();
  const AnyOffer message;
  for (const auto& policy : builtin_policies()) {
    const Plan plan = policy->plan(message.offer(), links, message.guidance);
    std::set<std::pair<std::uint8_t, LinkId>> seen;
    for (const Assignment& send : plan.sends) {
      RC_ASSERT(send.variant < message.variant_bytes.size());
      const auto link = std::ranges::find(links, send.link, &LinkState::id);
      RC_ASSERT(link != links.end());
      RC_ASSERT(link->up);
      RC_ASSERT(seen.emplace(send.variant, send.link).second);
    }
  }
}

RC_GTEST_PROP(PolicyProperty, SendsSomethingExactlyWhenALinkIsUp, ()) {
  const auto links = any_links();
  const AnyOffer message;
  for (const auto& policy : builtin_policies()) {
    const Plan plan = policy->plan(message.offer(), links, message.guidance);
    RC_ASSERT(plan.sends.empty() == std::ranges::none_of(links, &LinkState::up));
    RC_ASSERT(!(plan.sends.empty() && plan.under_floor));
  }
}

// Unless it is reported, each link can carry what it is given, as far as is known.
RC_GTEST_PROP(PolicyProperty, MeetsTheFloorOrReports, ()) {
  const auto links = any_links();
  const AnyOffer message;
  for (const auto& policy : builtin_policies()) {
    const Plan plan = policy->plan(message.offer(), links, message.guidance);
    if (plan.under_floor) continue;
    for (const Assignment& send : plan.sends) {
      const auto link = std::ranges::find(links, send.link, &LinkState::id);
      const DataRate floor = rate_floor(message.qos, message.variant_bytes[send.variant]);
      RC_ASSERT(link->rate == DataRate{} || link->rate >= floor);
    }
  }
}

// Of what was planned, the best variant is never held; degraded, nothing is. So a message is always
// delivered.
RC_GTEST_PROP(PolicyProperty, HoldsOnlyWhatABetterPlannedVariantMayReplace, ()) {
  const auto links = any_links();
  const AnyOffer message;
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

RC_GTEST_PROP(PolicyProperty, ScalingAllDelaysChangesNothing, (bool larger)) {
  const auto links = any_links();
  const AnyOffer message;
  std::vector<LinkState> scaled = links;
  const int factor = *rc::gen::inRange(2, larger ? 1000 : 4);
  for (LinkState& link : scaled) link.rtt_p95 *= factor;
  link::score(scaled);
  for (const auto& policy : builtin_policies()) {
    const Plan a = policy->plan(message.offer(), links, message.guidance);
    const Plan b = policy->plan(message.offer(), scaled, message.guidance);
    RC_ASSERT(a.sends == b.sends);
    RC_ASSERT(a.under_floor == b.under_floor);
  }
}

RC_GTEST_PROP(PolicyProperty, TheSameArgumentsGiveTheSameAnswer, ()) {
  const auto links = any_links();
  const AnyOffer message;
  for (const auto& policy : builtin_policies()) {
    const Plan a = policy->plan(message.offer(), links, message.guidance);
    const Plan b = policy->plan(message.offer(), links, message.guidance);
    RC_ASSERT(a.sends == b.sends);
    RC_ASSERT(a.under_floor == b.under_floor);
  }
}

}  // namespace
}  // namespace interneuron
