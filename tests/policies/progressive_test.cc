#include "interneuron/requirement.h"
#include "tests/policies/any.h"
#include "tests/policies/support.h"

namespace interneuron::policy_test::progressive_test {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::IsEmpty;

const Policy& progressive() {
  static const PolicySet policies = builtin_policies();
  return *find_policy(policies, "progressive");
}

const std::vector<std::size_t> kRegions{60 * 1024, 20 * 1024};

// Levels of 8, 19 and 44 ms follow.
Plan regions_at(Duration time_left, const std::vector<LinkState>& links, bool degraded = false) {
  const auto levels = three_levels();
  return progressive().plan({frames_at_10_hz(), kRegions, {}, 2}, links,
                            {.degraded = degraded, .time_left = time_left, .levels = levels});
}

TEST(Progressive, SendsTheSmallestFirst) {
  check("progressive", {
                           {"over the fastest that carries it",
                            {512 * 1024, 256 * 1024, 128 * 1024},
                            make_links({{1, 60, 50}, {2, 20, 100}, {3, 10, 9}}),
                            false,
                            {send(2, 2)},
                            false},
                           {"degraded: the same",
                            {512 * 1024, 128 * 1024},
                            make_links({{1, 60, 50}, {2, 20, 100}}),
                            true,
                            {send(1, 2)},
                            false},
                           {"none carries it: the fastest, reported",
                            {512 * 1024, 128 * 1024},
                            make_links({{1, 60, 5}, {2, 20, 4}}),
                            false,
                            {send(1, 2)},
                            true},
                       });
}

// Over 50 Mbit/s and 60 ms: 60 KB take 71 ms there and back, 20 KB 63 ms, and 8 ms of computation.
TEST(Progressive, SendsRegionsOverTheOtherLinkWhileThereIsTime) {
  const auto links = make_links({{1, 60, 50}, {2, 20, 100}});
  EXPECT_THAT(regions_at(milliseconds(90), links).sends, ElementsAre(send(0, 1)));
  EXPECT_THAT(regions_at(milliseconds(80), links).sends, ElementsAre(send(1, 1)));
  EXPECT_THAT(regions_at(milliseconds(90), links, true).sends, ElementsAre(send(1, 1)));
  EXPECT_THAT(regions_at(milliseconds(70), links).sends, IsEmpty());
  EXPECT_EQ(regions_at(milliseconds(70), links).refused, kNoTimeLeft);
}

TEST(Progressive, OneLinkCarriesBoth) {
  EXPECT_THAT(regions_at(milliseconds(90), make_links({{2, 20, 100}})).sends,
              ElementsAre(send(0, 2)));
}

TEST(Progressive, ResultsAlwaysGo) {
  QoS qos = frames_at_10_hz();
  qos.message_class = MessageClass::kResult;
  const Plan plan = progressive().plan({qos, kRegions, {}, 2}, make_links({{1, 60, 50}}),
                                       {.time_left = milliseconds(1)});
  EXPECT_THAT(plan.sends, ElementsAre(send(0, 1)));
}

RC_GTEST_PROP(ProgressiveProperty, TheFirstTransmissionIsOneSmallestVariant, ()) {
  const auto links = any_links();
  AnyMessage m;
  m.earlier_communications = 0;
  m.qos.message_class = MessageClass::kData;
  const Plan plan = progressive().plan(m.offer(), links, m.guidance);
  if (plan.sends.empty()) return;
  RC_ASSERT(plan.sends.size() == 1U);
  RC_ASSERT(plan.sends[0].variant == m.variant_bytes.size() - 1);
}

RC_GTEST_PROP(ProgressiveProperty, RegionsAreInTimeAndMoreTimeNeverStopsThem, ()) {
  const auto links = any_links();
  AnyMessage m;
  m.earlier_communications = 2;
  m.qos.message_class = MessageClass::kData;
  m.guidance.time_left = milliseconds(*rc::gen::inRange(0, 200));
  const Plan plan = progressive().plan(m.offer(), links, m.guidance);
  for (const Assignment& send : plan.sends) {
    const LinkState& link = link_of(links, send.link);
    RC_ASSERT(link.rate > DataRate{});
    RC_ASSERT(arrival_time(link, m.variant_bytes[send.variant]) < m.guidance.time_left);
  }
  m.guidance.time_left += milliseconds(*rc::gen::inRange(0, 100));
  const Plan later = progressive().plan(m.offer(), links, m.guidance);
  RC_ASSERT(later.sends.empty() <= plan.sends.empty());
}

RC_GTEST_PROP(ProgressiveProperty, RegionsLeaveTheFirstLinkAloneWhereAnotherCarriesThem, ()) {
  const auto links = any_links();
  AnyMessage m;
  m.earlier_communications = 2;
  m.qos.message_class = MessageClass::kData;
  m.guidance.time_left = Duration::max();
  const Plan plan = progressive().plan(m.offer(), links, m.guidance);
  if (plan.sends.empty()) return;
  const DataRate floor = rate_floor(m.qos, m.variant_bytes[plan.sends[0].variant]);
  const auto able = match({.min_rate = floor, .weights = {.delay = 1}}, links);
  RC_ASSERT(able.size() == 1 || plan.sends[0].link != able.front().id);
}

}  // namespace
}  // namespace interneuron::policy_test::progressive_test
