#include "tests/policies/any.h"
#include "tests/policies/support.h"

namespace interneuron::policy_test {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;

const Policy& joint() {
  static const PolicySet policies = builtin_policies();
  return *find_policy(policies, "joint");
}

Plan plan_at(Duration time_left, const std::vector<LinkState>& links, bool degraded = false) {
  const auto levels = three_levels();
  return joint().plan({frames_at_10_hz(), kRawAndSampled}, links,
                      {.degraded = degraded, .time_left = time_left, .levels = levels});
}

// 100 Mbit/s, 20 ms: raw takes 64 ms there and back, sampled 31 ms; the model of 44 ms on top.
TEST(Joint, TakesTheBestThatIsBackInTime) {
  const auto links = make_links({{1, 20, 100}});
  EXPECT_THAT(plan_at(milliseconds(130), links).sends, ElementsAre(send(0, 1)));
  EXPECT_THAT(plan_at(milliseconds(115), links).sends, ElementsAre(send(0, 1)));
  // Raw and the model of 19 ms are worth 0.348, sampled and that of 44 ms 0.383.
  EXPECT_THAT(plan_at(milliseconds(105), links).sends, ElementsAre(send(1, 1)));
  EXPECT_THAT(plan_at(milliseconds(45), links).sends, ElementsAre(send(1, 1)));
}

TEST(Joint, NothingInTimeOrNothingMeasuredSendsTheSmallest) {
  EXPECT_THAT(plan_at(milliseconds(10), make_links({{1, 20, 100}})).sends, ElementsAre(send(1, 1)));
  EXPECT_THAT(plan_at(milliseconds(130), make_links({{1, 0, 0}})).sends, ElementsAre(send(1, 1)));
  EXPECT_TRUE(plan_at(milliseconds(130), make_links({{1, 20, 5}})).under_floor);
}

TEST(Joint, ChoosesTheLinkThatTheBestVariantNeeds) {
  // The faster link cannot bring raw and the best model back in time, the wider one can.
  const auto links = make_links({{1, 10, 45}, {2, 30, 200}});
  EXPECT_THAT(plan_at(milliseconds(130), links).sends, ElementsAre(send(0, 2), send(1, 1)));
}

TEST(Joint, TheInsuranceIsNeverMetered) {
  auto links = make_links({{1, 20, 100}, {2, 40, 50}});
  EXPECT_THAT(plan_at(milliseconds(130), links).sends, ElementsAre(send(0, 1), send(1, 2)));
  links[1].traits.metered = true;
  EXPECT_THAT(plan_at(milliseconds(130), links).sends, ElementsAre(send(0, 1)));
}

TEST(Joint, DegradedIsTheSmallest) {
  const auto links = make_links({{1, 20, 100}, {2, 40, 50}});
  EXPECT_THAT(plan_at(milliseconds(130), links, true).sends, ElementsAre(send(1, 1), send(1, 2)));
}

TEST(Joint, WithoutLevelsTheBestVariantInTimeIsWanted) {
  const Offer offer{frames_at_10_hz(), kRawAndSampled};
  const auto links = make_links({{1, 20, 100}});
  EXPECT_THAT(joint().plan(offer, links, {}).sends, ElementsAre(send(0, 1)));
  EXPECT_THAT(joint().plan(offer, links, {.time_left = milliseconds(50)}).sends,
              ElementsAre(send(1, 1)));
}

// --- properties, against a search of its own over everything

// Expected quality of the best way over links that carry it; below any quality when none is in
// time.
double best_quality(const AnyMessage& m, const std::vector<LinkState>& links,
                    std::optional<Assignment> only = {}) {
  double best = -1;
  const std::size_t first = m.guidance.degraded ? m.variant_bytes.size() - 1 : 0;
  for (const LinkState& link : links) {
    for (std::size_t v = first; v < m.variant_bytes.size(); ++v) {
      if (only && (only->link != link.id || only->variant != v)) continue;
      const std::size_t bytes = m.variant_bytes[v];
      if (!link.up || link.rtt_p95 == Duration{} || link.rate == DataRate{}) continue;
      if (link.rate < rate_floor(m.qos, bytes)) continue;
      for (const LevelProfile& level : m.levels) {
        const Duration time = arrival_time(link, bytes) + level.median + link.rtt_p95 / 2;
        if (m.guidance.time_left != Duration::max() &&
            time + milliseconds(5) > m.guidance.time_left) {
          continue;
        }
        const auto& q = level.quality;
        best = std::max(best, q.empty() ? 0 : q[std::min(v, q.size() - 1)]);
      }
    }
  }
  return best;
}

RC_GTEST_PROP(JointProperty, NoOtherWayInTimeIsBetter, ()) {
  const auto links = any_links();
  const AnyMessage m;
  if (m.levels.empty()) return;
  const Plan plan = joint().plan(m.offer(), links, m.guidance);
  const double possible = best_quality(m, links);
  if (possible >= 0) RC_ASSERT(best_quality(m, links, plan.sends.front()) == possible);
}

RC_GTEST_PROP(JointProperty, MoreTimeNeverCostsQuality, ()) {
  const auto links = any_links();
  AnyMessage m;
  if (m.levels.empty()) return;
  m.guidance.time_left = milliseconds(*rc::gen::inRange(0, 200));
  const double before = best_quality(m, links);
  m.guidance.time_left += milliseconds(*rc::gen::inRange(0, 200));
  const Plan plan = joint().plan(m.offer(), links, m.guidance);
  if (before >= 0) RC_ASSERT(best_quality(m, links, plan.sends.front()) >= before);
}

RC_GTEST_PROP(JointProperty, TheInsuranceIsTheSmallestOverAnotherFreeLink, ()) {
  const auto links = any_links();
  const AnyMessage m;
  const Plan plan = joint().plan(m.offer(), links, m.guidance);
  RC_ASSERT(plan.sends.size() <= 2);
  if (plan.sends.size() < 2) return;
  const Assignment& copy = plan.sends.back();
  RC_ASSERT(copy.variant == m.variant_bytes.size() - 1);
  RC_ASSERT(copy.link != plan.sends.front().link);
  RC_ASSERT(!link_of(links, copy.link).traits.metered);
}

}  // namespace
}  // namespace interneuron::policy_test
