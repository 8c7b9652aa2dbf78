#include "core/link/estimators.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cstdint>

namespace interneuron::link::queue_signal_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

// The one-way delay as it is seen with a clock offset, wrapping as on the wire.
Duration seen(Duration delay, std::int64_t offset) {
  return Duration{wrapping_add(delay.count(), offset)};
}

TEST(QueueSignal, IsWhatIsAboveTheSmallestDelay) {
  for (const std::int64_t offset :
       {std::int64_t{0}, std::int64_t{-86'400'000'000'000}, INT64_MAX - 15'000'000, INT64_MIN}) {
    QueueSignal q;
    EXPECT_EQ(q.queue(at(0s)), 0ns);
    q.add(at(0s), seen(20ms, offset));
    EXPECT_EQ(q.queue(at(0s)), 0ns);
    for (int i = 1; i < 40; ++i) q.add(at(i * 50ms), seen(60ms, offset));
    EXPECT_NEAR(to_ms(q.queue(at(2s))), 40, 0.1) << offset;
    for (int i = 40; i < 80; ++i) q.add(at(i * 50ms), seen(20ms, offset));
    EXPECT_NEAR(to_ms(q.queue(at(4s))), 0, 0.1) << offset;
  }
}

TEST(QueueSignal, ForgetsWhatItHasNotSeenLately) {
  QueueSignal q;
  q.add(at(0s), 20ms);
  q.add(at(100ms), 80ms);
  EXPECT_GT(q.queue(at(2s)), 0ms);
  EXPECT_EQ(q.queue(at(3s)), 0ms);
}

TEST(QueueSignal, WhatNothingFollowedHasLeftAfterItsOwnLength) {
  QueueSignal q;
  q.add(at(0s), 20ms);
  for (int i = 1; i < 40; ++i) q.add(at(i * 50ms), 120ms);
  const Duration last = 39 * 50ms;
  EXPECT_NEAR(to_ms(q.left(at(last))), 100, 0.1);
  EXPECT_NEAR(to_ms(q.left(at(last + 60ms))), 40, 0.1);
  EXPECT_EQ(q.left(at(last + 200ms)), 0ns);
  EXPECT_NEAR(to_ms(q.queue(at(last + 200ms))), 100, 0.1);
}

TEST(QueueSignal, DriftOf100PpmIsAMillisecond) {
  QueueSignal q;
  for (int i = 0; i < 1200; ++i) {
    const Duration now = i * 50ms;
    q.add(at(now), 20ms + now / 10'000);
  }
  EXPECT_LE(q.queue(at(60s)), 1ms + 50us);
}

TEST(QueueSignal, ADelayThatStaysBecomesTheNewMinimum) {
  QueueSignal q;
  q.add(at(0s), 20ms);
  for (int i = 1; i <= 400; ++i) q.add(at(i * 50ms), 50ms);
  EXPECT_LT(q.queue(at(20s)), 1us);
}

TEST(QueueSignalProperty, SurvivesAnyPeer) {
  EXPECT_TRUE(rc::check([](const std::vector<std::int64_t>& delays) {
    QueueSignal q;
    TimePoint now{};
    for (const std::int64_t delay : delays) {
      q.add(now += 300ms, Duration{delay});
      RC_ASSERT(q.queue(now) >= 0ms && q.queue(now) <= 1min);
    }
  }));
}

}  // namespace
}  // namespace interneuron::link::queue_signal_test
