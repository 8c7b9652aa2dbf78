#include "tests/policies/any.h"
#include "tests/policies/support.h"

namespace interneuron::policy_test::joint_test {
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
  EXPECT_THAT(setting_out(plan_at(milliseconds(130), links)), ElementsAre(send(0, 1)));
  EXPECT_THAT(setting_out(plan_at(milliseconds(115), links)), ElementsAre(send(0, 1)));
  // Raw and the model of 19 ms are worth 0.348, sampled and that of 44 ms 0.383.
  EXPECT_THAT(setting_out(plan_at(milliseconds(105), links)), ElementsAre(send(1, 1)));
  EXPECT_THAT(setting_out(plan_at(milliseconds(45), links)), ElementsAre(send(1, 1)));
}

TEST(Joint, NothingInTimeOrNothingMeasuredSendsTheSmallest) {
  EXPECT_THAT(setting_out(plan_at(milliseconds(10), make_links({{1, 20, 100}}))),
              ElementsAre(send(1, 1)));
  EXPECT_THAT(setting_out(plan_at(milliseconds(130), make_links({{1, 0, 0}}))),
              ElementsAre(send(1, 1)));
  EXPECT_TRUE(plan_at(milliseconds(130), make_links({{1, 20, 5}})).under_floor);
}

TEST(Joint, ChoosesTheLinkThatTheBestVariantNeeds) {
  // The faster link cannot bring raw and the best model back in time, the wider one can.
  const auto links = make_links({{1, 10, 45}, {2, 30, 200}});
  EXPECT_THAT(setting_out(plan_at(milliseconds(130), links)), ElementsAre(send(0, 2), send(1, 1)));
}

TEST(Joint, TheInsuranceIsNeverMetered) {
  auto links = make_links({{1, 20, 100}, {2, 40, 50}});
  EXPECT_THAT(setting_out(plan_at(milliseconds(130), links)), ElementsAre(send(0, 1), send(1, 2)));
  links[1].traits.metered = true;
  EXPECT_THAT(setting_out(plan_at(milliseconds(130), links)), ElementsAre(send(0, 1)));
}

TEST(Joint, DegradedIsTheSmallest) {
  const auto links = make_links({{1, 20, 100}, {2, 40, 50}});
  EXPECT_THAT(setting_out(plan_at(milliseconds(130), links, true)),
              ElementsAre(send(1, 1), send(1, 2)));
}

TEST(Joint, WithoutLevelsTheBestVariantInTimeIsWanted) {
  const Offer offer{frames_at_10_hz(), kRawAndSampled};
  const auto links = make_links({{1, 20, 100}});
  EXPECT_THAT(setting_out(joint().plan(offer, links, {})), ElementsAre(send(0, 1)));
  EXPECT_THAT(setting_out(joint().plan(offer, links, {.time_left = milliseconds(50)})),
              ElementsAre(send(1, 1)));
}

// --- the four JPEGs of `--images jpeg`

// Bytes, and AP of the nets on them; what the program measures stands in src/lab/sim/offload.h.
constexpr std::array<std::size_t, 4> kJpegs{45'600, 24'800, 15'800, 10'000};
std::vector<LevelProfile> levels_on_jpegs() {
  return {{milliseconds(8), milliseconds(10), {0.139, 0.134, 0.136, 0.133}},
          {milliseconds(19), milliseconds(24), {0.353, 0.348, 0.347, 0.335}},
          {milliseconds(44), milliseconds(48), {0.397, 0.395, 0.394, 0.387}}};
}

Plan jpeg_plan(Duration time_left, const std::vector<LinkState>& links, bool degraded = false) {
  const auto levels = levels_on_jpegs();
  return joint().plan({frames_at_10_hz(), kJpegs}, links,
                      {.degraded = degraded, .time_left = time_left, .levels = levels});
}

// 10 Mbit/s, 40 ms: the rungs take 79, 61, 53 and 48 ms there and back; with the best model 123,
// 105, 97 and 92 ms, with the next one 25 ms less.
TEST(Joint, TakesTheRungWhoseBestLevelIsInTime) {
  const auto links = make_links({{1, 40, 10}});
  EXPECT_THAT(setting_out(jpeg_plan(milliseconds(130), links)), ElementsAre(send(0, 1)));
  EXPECT_THAT(setting_out(jpeg_plan(milliseconds(120), links)), ElementsAre(send(1, 1)));
  EXPECT_THAT(setting_out(jpeg_plan(milliseconds(105), links)), ElementsAre(send(2, 1)));
  EXPECT_THAT(setting_out(jpeg_plan(milliseconds(100), links)), ElementsAre(send(3, 1)));
  // The best model fits no more; the next one does on every rung but the first.
  EXPECT_THAT(setting_out(jpeg_plan(milliseconds(92), links)), ElementsAre(send(1, 1)));
}

TEST(Joint, OfFourRungsTheSmallestIsTheInsurance) {
  const auto links = make_links({{1, 40, 10}, {2, 50, 4}});
  EXPECT_THAT(setting_out(jpeg_plan(milliseconds(120), links)),
              ElementsAre(send(1, 1), send(3, 2)));
  EXPECT_THAT(setting_out(jpeg_plan(milliseconds(120), links, true)),
              ElementsAre(send(3, 1), send(3, 2)));
}

// The guard has weighed what the rung may lose; what is in time by the links alone is no matter.
TEST(Joint, TheRungThatTheGuardNamesGoes) {
  const auto levels = levels_on_jpegs();
  const auto links = make_links({{1, 40, 10}, {2, 50, 4}});
  for (const auto time_left : {milliseconds(250), milliseconds(20)}) {
    for (std::uint8_t rung = 0; rung < 3; ++rung) {
      const Plan plan = joint().plan({frames_at_10_hz(), kJpegs}, links,
                                     {.variant = rung, .time_left = time_left, .levels = levels});
      EXPECT_THAT(setting_out(plan), ElementsAre(send(rung, 1), send(3, 2)));
    }
  }
}

TEST(Joint, ASlowLinkCarriesASmallRung) {
  // At 10 Hz a link has to bring a rung in 100 ms; 3 Mbit/s bring the second one.
  const auto links = make_links({{1, 20, 3}});
  EXPECT_THAT(setting_out(jpeg_plan(milliseconds(250), links)), ElementsAre(send(1, 1)));
}

// A rung that no link carries at the rate of the frames would only make a queue.
TEST(Joint, OfTheRungThatTheGuardNamesAndSmallerOnesTheBestThatALinkCarriesGoes) {
  const auto plan = [](double mbit, std::uint8_t rung) {
    return setting_out(joint().plan({frames_at_10_hz(), kJpegs}, make_links({{1, 20, mbit}}),
                                    {.variant = rung, .time_left = milliseconds(250)}));
  };
  EXPECT_THAT(plan(3, 0), ElementsAre(send(1, 1)));
  EXPECT_THAT(plan(3, 2), ElementsAre(send(2, 1)));
  EXPECT_THAT(plan(0.1, 0), ElementsAre(send(3, 1)));
}

TEST(Joint, ARungThatMoreBytesDoNotMakeBetterIsPassedOver) {
  // Motion detectors see less in a coarse JPEG than in a smaller, finer one.
  std::vector<LevelProfile> motion{
      {milliseconds(3), milliseconds(4), {0.205, 0.189, 0.090, 0.155}}};
  const auto links = make_links({{1, 40, 10}});
  const Plan plan = joint().plan({frames_at_10_hz(), kJpegs}, links,
                                 {.time_left = milliseconds(62), .levels = motion});
  EXPECT_THAT(setting_out(plan), ElementsAre(send(3, 1)));
}

// --- properties, against a search of its own over everything

// Expected quality of the best way over links that carry it; below any quality when none is in
// time.
double best_quality(const AnyMessage& m, const std::vector<LinkState>& links,
                    std::optional<Assignment> only = {}) {
  double best = -1;
  const std::size_t first =
      m.guidance.degraded ? m.variant_bytes.size() - 1 : m.guidance.variant.value_or(0);
  const std::size_t end = m.guidance.variant ? first + 1 : m.variant_bytes.size();
  for (const LinkState& link : links) {
    for (std::size_t v = first; v < end; ++v) {
      if (only && (only->link != link.id || only->variant != v)) continue;
      const std::size_t bytes = m.variant_bytes[v];
      if (!link.up || link.rtt_p95 == Duration{} || link.rate == DataRate{}) continue;
      if (link.rate < rate_floor(m.qos, bytes)) continue;
      for (const LevelProfile& level : m.levels) {
        const Duration time = arrival_time(link, bytes) + level.median + link.rtt_p95 / 2;
        const bool is_late = m.guidance.time_left != Duration::max() &&
                             time + milliseconds(5) > m.guidance.time_left;
        if (is_late) continue;
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
  const Assignments sent = setting_out(plan);
  RC_ASSERT(sent.size() <= 2);
  if (sent.size() < 2) return;
  const Assignment& copy = sent.back();
  RC_ASSERT(copy.variant == m.variant_bytes.size() - 1);
  RC_ASSERT(copy.link != sent.front().link);
  RC_ASSERT(!link_of(links, copy.link).traits.metered);
}

}  // namespace
}  // namespace interneuron::policy_test::joint_test
