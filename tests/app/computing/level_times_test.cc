#include "app/computing/peer_accounts.h"

#include <gtest/gtest.h>

namespace interneuron::computing::level_times_test {
namespace {

using namespace std::chrono_literals;

LevelTimes three_levels() {
  return LevelTimes({{8ms, 10ms, {}}, {19ms, 24ms, {}}, {44ms, 48ms, {}}});
}

TEST(LevelTimes, TakesTheHighestLevelThatFits) {
  const LevelTimes times = three_levels();
  EXPECT_EQ(times.highest_within(100ms), 2u);
  EXPECT_EQ(times.highest_within(48ms), 2u);
  EXPECT_EQ(times.highest_within(48ms - 1ns), 1u);
  EXPECT_EQ(times.highest_within(10ms), 0u);
}

TEST(LevelTimes, TakesTheLowestLevelWhenNoneFits) {
  EXPECT_EQ(three_levels().highest_within(0ms), 0u);
  EXPECT_EQ(three_levels().highest_within(-5ms), 0u);
}

TEST(LevelTimes, FewRunsChangeNothing) {
  LevelTimes times = three_levels();
  for (std::size_t i = 1; i < LevelTimes::kFewest; ++i) times.learn(2, 90ms);
  EXPECT_EQ(times.p95(2), 48ms);
  times.learn(2, 90ms);
  EXPECT_EQ(times.p95(2), 90ms);
  EXPECT_EQ(times.p95(1), 24ms) << "the other levels keep theirs";
}

TEST(LevelTimes, QuickRunsDoNotUndercutTheCalibration) {
  LevelTimes times = three_levels();
  for (int i = 0; i < 100; ++i) times.learn(1, 1ms);
  EXPECT_EQ(times.p95(1), 24ms);
}

TEST(LevelTimes, OldRunsAreForgotten) {
  LevelTimes times = three_levels();
  for (int i = 0; i < 100; ++i) times.learn(1, 60ms);
  EXPECT_EQ(times.highest_within(50ms), 2u) << "level 2 has not become slower";
  EXPECT_EQ(times.highest_within(30ms), 0u);
  for (std::size_t i = 0; i < LevelTimes::kRemembered; ++i) times.learn(1, 19ms);
  EXPECT_EQ(times.p95(1), 24ms);
  EXPECT_EQ(times.highest_within(30ms), 1u);
}

TEST(LevelTimes, TheLeastIsTheQuickestOfTheLowestLevel) {
  LevelTimes times = three_levels();
  EXPECT_EQ(times.least(), 8ms);
  times.learn(0, 20ms);
  times.learn(1, 1ms);
  EXPECT_EQ(times.least(), 8ms);
  times.learn(0, 6ms);
  EXPECT_EQ(times.least(), 6ms);
  for (std::size_t i = 0; i < LevelTimes::kRemembered; ++i) times.learn(0, 9ms);
  EXPECT_EQ(times.least(), 8ms);
}

TEST(LevelTimes, OneSlowRunOfFortyIsNotThePercentile) {
  LevelTimes times = three_levels();
  times.learn(0, 500ms);
  for (std::size_t i = 1; i < LevelTimes::kRemembered; ++i) times.learn(0, 9ms);
  EXPECT_EQ(times.p95(0), 10ms);
}

}  // namespace
}  // namespace interneuron::computing::level_times_test
