// When an estimate counts as having followed a step.
#include <gtest/gtest.h>

#include "bench/nature/nature_steps.h"

namespace interneuron::bench::bench_nature_test {
namespace {

using std::chrono::milliseconds;

Belief rtt_at(int ms, double rtt_ms, double own_score) {
  Belief belief{.at = milliseconds(ms), .rtt_ms = rtt_ms};
  belief.nature.delay = own_score;
  belief.reference.delay = 1.5 - own_score;
  return belief;
}

const Step kSlower{Quantity::kRtt, {.rtt_ms = 40}, {.rtt_ms = 90}};

TEST(BenchNature, TellsWhenAStepWasNoticedSettledAndRanked) {
  const std::vector<Belief> beliefs{rtt_at(1000, 40, 1.0), rtt_at(1020, 66, 0.9),
                                    rtt_at(1040, 89, 0.6), rtt_at(1060, 90.5, 0.6)};
  const Convergence c = converge(kSlower, false, milliseconds(1000), beliefs);
  EXPECT_EQ(c.noticed, milliseconds(20));
  EXPECT_EQ(c.settled, milliseconds(40));
  EXPECT_EQ(c.ranked, milliseconds(40));
  EXPECT_EQ(c.last, 90.5);
}

TEST(BenchNature, AnEstimateThatLeavesAgainHasNotSettled) {
  const std::vector<Belief> beliefs{rtt_at(1000, 90, 0.6), rtt_at(1020, 60, 0.6),
                                    rtt_at(1040, 90, 0.6), rtt_at(1060, 70, 0.9)};
  const Convergence c = converge(kSlower, false, milliseconds(1000), beliefs);
  EXPECT_EQ(c.noticed, Duration::zero());
  EXPECT_EQ(c.settled, std::nullopt);
  EXPECT_EQ(c.ranked, std::nullopt);
}

TEST(BenchNature, NothingFollowsWithoutBeliefs) {
  const Convergence c = converge(kSlower, true, Duration::zero(), {});
  EXPECT_EQ(c.noticed, std::nullopt);
  EXPECT_EQ(c.settled, std::nullopt);
}

// Each step moves the link from one side of the reference to the other, so that ranks can follow.
TEST(BenchNature, EveryStepCrossesTheReference) {
  const Belief reference{{}, kReference.rtt_ms, kReference.loss, kReference.rate_mbit, {}, {}};
  for (const Step& step : steps()) {
    const double middle = reference.of(step.what);
    EXPECT_LT((step.from() - middle) * (step.to() - middle), 0) << name_of(step.what);
  }
}

TEST(BenchNature, TellsWhenAnOutageWasNoticedAndOver) {
  const std::vector<PathStep> steps{{milliseconds(100), PathState::kOk},
                                    {milliseconds(1030), PathState::kSuspect},
                                    {milliseconds(1060), PathState::kPulled},
                                    {milliseconds(4200), PathState::kOk}};
  const OutageNotice n = notice(milliseconds(1000), steps);
  EXPECT_EQ(n.suspected, milliseconds(30));
  EXPECT_EQ(n.abandoned, milliseconds(60));
  EXPECT_EQ(n.back, milliseconds(200));
}

TEST(BenchNature, AnOutageThatNobodyNoticedSaysSo) {
  const OutageNotice n = notice(milliseconds(1000), {});
  EXPECT_EQ(n.suspected, std::nullopt);
  EXPECT_EQ(n.back, std::nullopt);
}

}  // namespace
}  // namespace interneuron::bench::bench_nature_test
