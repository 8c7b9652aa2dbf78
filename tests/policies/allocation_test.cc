// A decision of a policy costs no allocation: its plan, made safe to carry out, and the forecast of
// its answers.

#include "core/plan/budget.h"
#include "core/plan/plan_message.h"
#include "interneuron/requirement.h"
#include "tests/counted_heap.h"
#include "tests/policies/support.h"

namespace interneuron::policy_test::allocation_test {
namespace {

TEST(PolicyAllocation, IsSeenByThisTest) {
  const std::uint64_t before = allocations;
  const std::vector<int> v(100);
  EXPECT_GT(allocations, before) << v.size();
}

// Plans a message of each class, in variants and whole, degraded and not. Returns how many sends
// were planned.
std::size_t plan_any_message(const Policy& policy, const std::vector<LinkState>& links,
                             const std::vector<LevelProfile>& levels,
                             const std::vector<VariantCost>& costs) {
  constexpr std::size_t kSmall[] = {2000};
  std::size_t sends = 0;
  for (const bool degraded : {false, true}) {
    for (const MessageClass c : {MessageClass::kData, MessageClass::kResult}) {
      for (const bool whole : {false, true}) {
        QoS qos = frames_at_10_hz();
        qos.message_class = c;
        Offer offer{qos, kRawAndSampled, costs, static_cast<std::uint8_t>(degraded ? 2 : 0)};
        if (whole) offer = {qos, kSmall};
        const Guidance guidance{.degraded = degraded,
                                .time_left = std::chrono::milliseconds(120),
                                .levels = levels,
                                .local_quality = 0.3};
        const Plan plan = plan::plan_message(policy, offer, links, guidance);
        static_cast<void>(plan::forecast_answers(plan, offer, links));
        sends += plan.sends.size();
      }
    }
  }
  return sends;
}

TEST(PolicyAllocation, NoneForAnyMessageOfAnyPolicy) {
  const PolicySet policies = builtin_policies();
  const std::vector<LevelProfile> levels = three_levels();
  std::vector<LinkState> links = make_links({{1, 60, 50}, {2, 20, 100}, {3, 10, 9}, {4, 0, 0}});
  for (LinkState& link : links) link.traits.trusted = link.id.value != 2;
  link::score(links);
  const std::vector<VariantCost> costs(2);
  std::size_t sends = 0;
  const std::uint64_t before = allocations;
  for (const auto& policy : policies) sends += plan_any_message(*policy, links, levels, costs);
  EXPECT_EQ(allocations, before);
  EXPECT_GT(sends, 2 * policies.size());
}

TEST(PolicyAllocation, NoneOfMoreLinksThanAreWeighed) {
  std::vector<LinkState> links(3 * kMaxLinks);
  for (std::size_t i = 0; i < links.size(); ++i) {
    links[i].id = LinkId{static_cast<std::uint8_t>(i)};
    links[i].up = true;
    links[i].nature.delay = 0.01 * static_cast<double>(i);
  }
  const std::uint64_t before = allocations;
  const Links best = match({.weights = {.delay = 1}}, links);
  EXPECT_EQ(allocations, before);
  ASSERT_EQ(best.size(), kMaxLinks);
  EXPECT_EQ(best.front().id.value, links.size() - 1);
  EXPECT_EQ(best.back().id.value, links.size() - kMaxLinks);
}

}  // namespace
}  // namespace interneuron::policy_test::allocation_test
