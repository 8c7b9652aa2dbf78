#include "tests/policies/any.h"
#include "tests/policies/support.h"

namespace interneuron::policy_test::split_test {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;

const Policy& split() {
  static const PolicySet policies = builtin_policies();
  return *find_policy(policies, "split");
}

// A network of three cuts: all there, half each, nearly all here.
const std::vector<std::size_t> kCuts{512 * 1024, 128 * 1024, 8 * 1024};
const std::vector<VariantCost> kCosts{{milliseconds(0), milliseconds(20)},
                                      {milliseconds(15), milliseconds(10)},
                                      {milliseconds(60), milliseconds(1)}};

Assignments sends_over(const std::vector<LinkState>& links) {
  return split().plan({frames_at_10_hz(), kCuts, kCosts}, links, {}).sends;
}

TEST(Split, CutsWhereTheWholeIsSoonest) {
  EXPECT_THAT(sends_over(make_links({{1, 20, 1000}})), ElementsAre(send(0, 1)));
  EXPECT_THAT(sends_over(make_links({{1, 20, 50}})), ElementsAre(send(1, 1)));
  EXPECT_THAT(sends_over(make_links({{1, 20, 11}})), ElementsAre(send(2, 1)));
}

TEST(Split, TakesTheLinkThatIsBestForTheCut) {
  // 5 ms more of round trip, and the whole input in a twentieth of the time.
  EXPECT_THAT(sends_over(make_links({{1, 20, 50}, {2, 25, 1000}})), ElementsAre(send(0, 2)));
}

TEST(Split, NothingMeasuredSendsTheSmallest) {
  EXPECT_THAT(sends_over(make_links({{1, 0, 0}})), ElementsAre(send(2, 1)));
  const Plan plan =
      split().plan({frames_at_10_hz(), kCuts, kCosts}, make_links({{1, 20, 0.1}}), {});
  EXPECT_THAT(plan.sends, ElementsAre(send(2, 1)));
  EXPECT_TRUE(plan.under_floor);
}

Duration total(const AnyMessage& m, const LinkState& link, std::size_t cut) {
  const VariantCost cost = m.costs.empty() ? VariantCost{} : m.costs[cut];
  return cost.here + arrival_time(link, m.variant_bytes[cut]) + cost.there + link.rtt_p95 / 2;
}

RC_GTEST_PROP(SplitProperty, NoOtherCutOrLinkIsSooner, ()) {
  const auto links = any_links();
  const AnyMessage m;
  const Plan plan = split().plan(m.offer(), links, m.guidance);
  if (plan.sends.empty() || plan.under_floor) return;
  RC_ASSERT(plan.sends.size() == 1U);
  const LinkState& chosen = link_of(links, plan.sends[0].link);
  for (const LinkState& link : links) {
    if (!link.up || link.rtt_p95 == Duration{} || link.rate == DataRate{}) continue;
    for (std::size_t cut = 0; cut < m.variant_bytes.size(); ++cut) {
      if (link.rate < rate_floor(m.qos, m.variant_bytes[cut])) continue;
      RC_ASSERT(chosen.rate > DataRate{});
      RC_ASSERT(total(m, chosen, plan.sends[0].variant) <= total(m, link, cut));
    }
  }
}

}  // namespace
}  // namespace interneuron::policy_test::split_test
