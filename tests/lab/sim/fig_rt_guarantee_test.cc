// The phases of the paper's Fig. rt_guarantee; lab/sim/fig_rt_guarantee.h says which.
#include "lab/sim/fig_rt_guarantee.h"

#include <gtest/gtest.h>

#include <cstdio>

namespace interneuron::sim::fig_rt_guarantee_test {
namespace {

TEST(FigRtGuarantee, ThePapersSequence) {
  const OffloadResult result = run_fig_rt_guarantee();
  for (const OffloadRound& r : result.rounds) {
    ASSERT_TRUE(r.at_road) << "round " << r.round;
    const auto& road = *r.at_road;
    std::printf(
        "%2u e2e %6.1f X %+.3f variant %d late %d overrun %5.1f at D1 %d level %zu D2 missed %d\n",
        r.round, to_ms(r.done.e2e), r.done.x_permille / 1000.0, road.variant, road.verdict.late,
        to_ms(road.verdict.overrun), road.verdict.released_at_deadline, road.level,
        r.done.degraded_final);
    EXPECT_EQ(r.done.outcome, Outcome::kRemote) << "round " << r.round;
    EXPECT_EQ(road.variant, r.round < 5 ? 0 : 1) << "round " << r.round;
    EXPECT_EQ(road.verdict.released_at_deadline, r.round >= 5 && r.round <= 7)
        << "round " << r.round;
    EXPECT_EQ(road.verdict.late, r.round >= 8) << "round " << r.round;
    EXPECT_EQ(road.level, r.round < 8 ? 2U : r.round < 10 ? 1U : 0U) << "round " << r.round;
    EXPECT_EQ(r.done.degraded_final, r.round >= 11) << "round " << r.round;
  }
  // The reference rises with the slower rounds, so X falls.
  EXPECT_LT(result.rounds[6].done.x_permille, result.rounds[3].done.x_permille);
}

}  // namespace
}  // namespace interneuron::sim::fig_rt_guarantee_test
