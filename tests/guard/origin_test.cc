#include "guard/origin.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace interneuron::guard {
namespace {

using namespace std::chrono_literals;

PipelineConfig camera() {
  PipelineConfig c;
  c.stages = {StageKind::kCommunication, StageKind::kComputation, StageKind::kCommunication};
  return c;
}

Bytes bytes(int n) { return Bytes{static_cast<std::byte>(n)}; }

constexpr SessionId kSelf{7};

TEST(Origin, ARemoteResultExactlyAtTheDeadlineIsOnTime) {
  Origin o(camera(), kSelf);
  const auto begun = o.begin(TimePoint{1s});
  const auto done = o.remote_result(TimePoint{1s + 130ms}, begun.ref.round, bytes(1), false);
  ASSERT_TRUE(done);
  EXPECT_EQ(done->outcome, Outcome::kRemote);
  EXPECT_EQ(done->e2e, 130ms);
  EXPECT_EQ(done->age_rounds, 0U);
  EXPECT_TRUE(o.expire(TimePoint{10s}).empty());  // exactly one outcome
}

TEST(Origin, OneNanosecondLaterItIsDropped) {
  Origin o(camera(), kSelf);
  const auto begun = o.begin(TimePoint{1s});
  EXPECT_FALSE(o.remote_result(TimePoint{1s + 130ms + 1ns}, begun.ref.round, bytes(1), false));
  const auto done = o.expire(TimePoint{1s + 131ms});
  ASSERT_EQ(done.size(), 1U);
  EXPECT_EQ(done[0].outcome, Outcome::kLocal);
}

TEST(Origin, TheLocalBackupAnswersAtTheDeadline) {
  Origin o(camera(), kSelf);
  const auto begun = o.begin(TimePoint{1s});
  o.local_result(begun.ref.round, bytes(9));
  EXPECT_EQ(o.next_timeout(), TimePoint{1s + 130ms});
  EXPECT_TRUE(o.expire(TimePoint{1s + 130ms - 1ns}).empty());
  const auto done = o.expire(TimePoint{1s + 130ms});
  ASSERT_EQ(done.size(), 1U);
  EXPECT_EQ(done[0].result, bytes(9));
  EXPECT_EQ(done[0].age_rounds, 0U);
}

TEST(Origin, WithoutABackupTheLastResultIsMarkedWithItsAge) {
  Origin o(camera(), kSelf);
  const auto first = o.begin(TimePoint{1s});
  o.remote_result(TimePoint{1s + 10ms}, first.ref.round, bytes(1), false);
  o.begin(TimePoint{2s});
  o.begin(TimePoint{3s});
  const auto done = o.expire(TimePoint{4s});
  ASSERT_EQ(done.size(), 2U);
  EXPECT_EQ(done[0].age_rounds, 1U);
  EXPECT_EQ(done[1].age_rounds, 2U);
  EXPECT_EQ(done[1].result, bytes(1));
}

TEST(Origin, WithNothingAtAllTheAnswerIsEmptyAndMarkedSo) {
  Origin o(camera(), kSelf);
  o.begin(TimePoint{1s});
  const auto done = o.expire(TimePoint{2s});
  ASSERT_EQ(done.size(), 1U);
  EXPECT_TRUE(done[0].result.empty());
  EXPECT_FALSE(done[0].age_rounds);
}

TEST(Origin, AForwardJumpAnswersOpenRoundsAtOnce) {
  Origin o(camera(), kSelf);
  o.begin(TimePoint{1s});
  o.begin(TimePoint{1s + 100ms});
  EXPECT_EQ(o.expire(TimePoint{1h}).size(), 2U);
}

TEST(Origin, TheIndicatorTellsTheRoundsBefore) {
  Origin o(camera(), kSelf);
  const auto r0 = o.begin(TimePoint{1s});
  o.remote_result(TimePoint{1s + 10ms}, r0.ref.round, bytes(1), false);
  o.begin(TimePoint{2s});
  o.expire(TimePoint{3s});
  o.begin(TimePoint{3s});
  const auto r3 = o.begin(TimePoint{3s + 100ms});
  const Indicator i = o.indicator(r3.ref.round);
  EXPECT_EQ(i[0], RoundState::kUnknown);
  EXPECT_EQ(i[1], RoundState::kMissed);
  EXPECT_EQ(i[2], RoundState::kOnTime);
  EXPECT_EQ(i[3], RoundState::kUnknown);
}

TEST(Origin, RefusesWhatCannotBeAPipeline) {
  PipelineConfig none = camera();
  none.stages.clear();
  EXPECT_THROW(Origin(none, kSelf), std::invalid_argument);
  PipelineConfig zero = camera();
  zero.deadline = 0ms;
  EXPECT_THROW(Origin(zero, kSelf), std::invalid_argument);
  PipelineConfig period = camera();
  period.period = -1ms;
  EXPECT_THROW(Origin(period, kSelf), std::invalid_argument);
}

}  // namespace
}  // namespace interneuron::guard
