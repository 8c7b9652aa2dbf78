#include "tests/policies/any.h"
#include "tests/policies/support.h"

namespace interneuron::policy_test::placement_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

const Policy& placement() {
  static const PolicySet policies = builtin_policies();
  return *find_policy(policies, "placement");
}

std::vector<LinkState> measured(std::vector<LinkState> links, Duration rate_age) {
  for (LinkState& link : links) {
    link.rate_age = rate_age;
    link.confidence = 1;
  }
  return links;
}

Plan plan_at(double local_quality, Duration time_left, const std::vector<LinkState>& links) {
  const auto levels = three_levels();
  return placement().plan(
      {frames_at_10_hz(), kRawAndSampled}, links,
      {.time_left = time_left, .levels = levels, .local_quality = local_quality});
}

TEST(Placement, OffloadsWhatIsWorthMoreElsewhere) {
  const auto links = measured(make_links({{1, 20, 100}}), milliseconds(50));
  EXPECT_THAT(setting_out(plan_at(0.136, milliseconds(130), links)), ElementsAre(send(0, 1)));
  const Plan local = plan_at(0.4, milliseconds(130), links);
  EXPECT_THAT(local.sends, IsEmpty());
  EXPECT_EQ(local.refused, kLocalIsBetter);
}

TEST(Placement, StaysLocalWhenNothingIsBackInTime) {
  const auto links = measured(make_links({{1, 120, 100}}), milliseconds(50));
  EXPECT_EQ(plan_at(0.136, milliseconds(130), links).refused, kLocalIsBetter);
}

// There and back takes 75 ms with sampled and the second model; worth more than local in time.
TEST(Placement, ComesBackOnlyWithRoomToSpare) {
  const auto links = make_links({{1, 45, 100}});
  const Duration just_enough = milliseconds(82);
  EXPECT_THAT(setting_out(plan_at(0.2, just_enough, measured(links, milliseconds(150)))),
              ElementsAre(send(1, 1)));
  EXPECT_EQ(plan_at(0.2, just_enough, measured(links, seconds(5))).refused, kLocalIsBetter);
  EXPECT_THAT(setting_out(plan_at(0.2, milliseconds(95), measured(links, seconds(5)))),
              ElementsAre(send(1, 1)));
}

TEST(Placement, TriesWhatIsNotKnownAnyMore) {
  const auto slow = make_links({{1, 120, 100}});
  EXPECT_FALSE(plan_at(0.136, milliseconds(130), measured(slow, seconds(60))).sends.empty());
  EXPECT_FALSE(plan_at(0.136, milliseconds(130), make_links({{1, 0, 0}})).sends.empty());
}

TEST(Placement, ResultsAlwaysGo) {
  const auto links = measured(make_links({{1, 120, 100}}), milliseconds(50));
  const auto levels = three_levels();
  QoS qos = frames_at_10_hz();
  qos.message_class = MessageClass::kResult;
  const Guidance guidance{.time_left = milliseconds(1), .levels = levels, .local_quality = 1};
  EXPECT_FALSE(placement().plan({qos, kRawAndSampled}, links, guidance).sends.empty());
}

RC_GTEST_PROP(PlacementProperty, ABetterLocalResultNeverLeadsToOffloading, ()) {
  const auto links = any_links();
  AnyMessage m;
  m.guidance.local_quality += 0.01;
  const Plan before = placement().plan(m.offer(), links, m.guidance);
  m.guidance.local_quality += 0.01 * *rc::gen::inRange(0, 100);
  const Plan after = placement().plan(m.offer(), links, m.guidance);
  if (!before.refused.empty()) RC_ASSERT(after.refused == before.refused);
}

RC_GTEST_PROP(PlacementProperty, WhatIsWorthReturningToIsWorthStayingAt, ()) {
  auto links = any_links();
  AnyMessage m;
  m.qos.period = milliseconds(100);
  for (LinkState& link : links) {
    link.confidence = 1;
    link.rate_age = seconds(5);
  }
  const Plan returning = placement().plan(m.offer(), links, m.guidance);
  for (LinkState& link : links) link.rate_age = milliseconds(100);
  const Plan staying = placement().plan(m.offer(), links, m.guidance);
  if (returning.refused.empty()) RC_ASSERT(staying.refused.empty());
}

RC_GTEST_PROP(PlacementProperty, OffloadsAsJointDoes, ()) {
  const auto links = any_links();
  const AnyMessage m;
  const PolicySet policies = builtin_policies();
  const Plan plan = placement().plan(m.offer(), links, m.guidance);
  if (!plan.refused.empty()) return;
  RC_ASSERT(plan.sends == find_policy(policies, "joint")->plan(m.offer(), links, m.guidance).sends);
}

}  // namespace
}  // namespace interneuron::policy_test::placement_test
