#include "core/guard/observers.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace interneuron::guard::reference_time_test {
namespace {

using namespace std::chrono_literals;

const TimePoint kNow{1s};

TEST(ReferenceTime, TheFirstHistoryIsTheBase) {
  ReferenceTime t;
  t.observe(RoundId{0}, 1, 50ms);
  EXPECT_FALSE(t.base(kNow, 1));
  t.settle(kNow, RoundId{0}, RoundState::kOnTime);
  EXPECT_EQ(t.base(kNow, 1), 50ms);
  EXPECT_FALSE(t.base(kNow, 2));
}

TEST(ReferenceTime, SmoothsTowardsTheHistory) {
  EXPECT_EQ(smoothed(100ms, 50ms), 65ms);                      // 0.3 * 100 + 0.7 * 50
  EXPECT_EQ(smoothed(Duration{0}, Duration{5}), Duration{3});  // 5 - 1.5, half away from zero
  EXPECT_EQ(smoothed(Duration{5}, Duration{0}), Duration{2});  // 0 + 1.5
}

RC_GTEST_PROP(ReferenceTime, SmoothingIsInvariantToAnyOffset, (std::int64_t offset)) {
  const auto base = *rc::gen::inRange<std::int64_t>(0, 2'000'000'000);
  const auto theta = *rc::gen::inRange<std::int64_t>(0, 2'000'000'000);
  const Duration plain = smoothed(Duration{base}, Duration{theta});
  const Duration moved =
      smoothed(Duration{wrapping_add(base, offset)}, Duration{wrapping_add(theta, offset)});
  RC_ASSERT(wrapping_sub(moved.count(), offset) == plain.count());
}

TEST(ReferenceTime, AMissedOrUndecidedRoundLeavesNoTrace) {
  ReferenceTime t;
  t.observe(RoundId{0}, 1, 50ms);
  t.observe(RoundId{1}, 1, 90ms);
  t.observe(RoundId{2}, 1, 70ms);
  t.settle(kNow, RoundId{0}, RoundState::kOnTime);
  t.settle(kNow, RoundId{1}, RoundState::kMissed);
  EXPECT_EQ(t.base(kNow, 1), 50ms);
}

TEST(ReferenceTime, ForgetsAfterAMinuteWithoutAnAcceptedHistory) {
  ReferenceTime t;
  t.observe(RoundId{0}, 1, 50ms);
  t.settle(kNow, RoundId{0}, RoundState::kOnTime);
  EXPECT_TRUE(t.base(kNow + 60s, 1));
  EXPECT_FALSE(t.base(kNow + 60s + 1ns, 1));
}

TEST(ReferenceTime, AStragglerDoesNotPushOutAYoungerRound) {
  ReferenceTime t;
  t.observe(RoundId{64}, 1, 50ms);
  t.observe(RoundId{0}, 1, 10ms);  // the same slot of the ring
  t.settle(kNow, RoundId{64}, RoundState::kOnTime);
  EXPECT_EQ(t.base(kNow, 1), 50ms);
}

}  // namespace
}  // namespace interneuron::guard::reference_time_test
