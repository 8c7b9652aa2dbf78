#include "core/guard/origins.h"

#include <gtest/gtest.h>

namespace interneuron::guard::x_controller_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kDeadline = 130ms;

TEST(XController, IsZeroUntilThereIsABase) {
  XController x({});
  const auto sent = x.begin(std::nullopt, kDeadline);
  EXPECT_EQ(sent.x_permille, 0);
  EXPECT_FALSE(sent.recovering);
  EXPECT_FALSE(sent.degraded);
}

TEST(XController, IsTheSlackOfTheReferencePlusBeta) {
  EXPECT_EQ(XController({}).begin(104ms, kDeadline).x_permille, 200);
  EXPECT_EQ(XController({.beta_permille = 50}).begin(104ms, kDeadline).x_permille, 250);
  EXPECT_EQ(XController({.ablation = {.use_x = false}}).begin(104ms, kDeadline).x_permille, 0);
}

TEST(XController, AMissTakesOneAndDegradesExactlyOneRound) {
  XController x({});
  x.begin(104ms, kDeadline);
  x.missed();
  auto sent = x.begin(104ms, kDeadline);
  EXPECT_EQ(sent.x_permille, -800);
  EXPECT_TRUE(sent.recovering);
  EXPECT_TRUE(sent.degraded);
  sent = x.begin(104ms, kDeadline);
  EXPECT_TRUE(sent.recovering);
  EXPECT_FALSE(sent.degraded);
}

TEST(XController, TwoMissesDegradeTwoRoundsAndXStopsAtMinusOne) {
  XController x({});
  x.begin(104ms, kDeadline);
  x.missed();
  x.missed();
  EXPECT_EQ(x.begin(104ms, kDeadline).x_permille, -1000);
  EXPECT_TRUE(x.begin(104ms, kDeadline).degraded);
  EXPECT_FALSE(x.begin(104ms, kDeadline).degraded);
}

TEST(XController, RecoversByTheRoundsSentWhileRecoveringOnly) {
  XController x({});
  x.begin(104ms, kDeadline);
  x.missed();        // -800
  x.on_time(false);  // was in flight at the miss
  EXPECT_EQ(x.begin(104ms, kDeadline).x_permille, -800);
  for (const int expected : {-600, -400, -200}) {
    x.on_time(true);
    EXPECT_EQ(x.begin(104ms, kDeadline).x_permille, expected);
  }
  x.on_time(true);  // 0: recovered
  const auto sent = x.begin(91ms, kDeadline);
  EXPECT_EQ(sent.x_permille, 300);
  EXPECT_FALSE(sent.recovering);
}

TEST(XController, WithoutTheHandlerAMissChangesNothing) {
  XController x({.ablation = {.use_handler = false}});
  x.begin(104ms, kDeadline);
  x.missed();
  const auto sent = x.begin(104ms, kDeadline);
  EXPECT_EQ(sent.x_permille, 200);
  EXPECT_FALSE(sent.degraded);
}

}  // namespace
}  // namespace interneuron::guard::x_controller_test
