#include "core/guard/stage_guard.h"

#include <gtest/gtest.h>

#include <vector>

namespace interneuron::guard::stage_guard_test {
namespace {

using namespace std::chrono_literals;

const std::vector<LevelProfile> kLevels{{8ms, 8ms}, {19ms, 19ms}, {44ms, 44ms}};

Verdict late(Duration overrun) { return {.late = true, .overrun = overrun}; }

TEST(SacrificedLevel, WithinTheStageDeadlineNothingIsSacrificed) {
  EXPECT_EQ(sacrificed_level(kLevels, 2, {}), 2U);
}

TEST(SacrificedLevel, LateIsAtLeastOneStepDown) {
  EXPECT_EQ(sacrificed_level(kLevels, 2, late(1ns)), 1U);
  EXPECT_EQ(sacrificed_level(kLevels, 1, late(1ns)), 0U);
}

TEST(SacrificedLevel, MakesUpForTheOverrun) {
  EXPECT_EQ(sacrificed_level(kLevels, 2, late(25ms)), 1U);
  EXPECT_EQ(sacrificed_level(kLevels, 2, late(25ms + 1ns)), 0U);
}

TEST(SacrificedLevel, TheLowestWhenNothingSuffices) {
  EXPECT_EQ(sacrificed_level(kLevels, 2, late(10s)), 0U);
  EXPECT_EQ(sacrificed_level(kLevels, 2, late(kFullSeverity)), 0U);
  EXPECT_EQ(sacrificed_level(kLevels, 0, late(kFullSeverity)), 0U);
}

TEST(SacrificedLevel, WithoutLevelsThereIsNothingToChoose) {
  EXPECT_EQ(sacrificed_level({}, 0, late(1ms)), 0U);
}

}  // namespace
}  // namespace interneuron::guard::stage_guard_test
