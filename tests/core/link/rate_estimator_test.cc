#include "core/link/rate_estimator.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace interneuron::link::rate_estimator_test {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kPacketBytes = 1428;

TimePoint at(Duration d) { return TimePoint{d}; }
DataRate mbit(double value) { return DataRate::mbit(value); }
Train train_of(std::uint64_t id, std::uint32_t packets, DataRate measured,
               std::optional<DataRate> sent_at, Duration pause = {}) {
  return {id, packets, packets, (packets - 1) * kPacketBytes, measured, sent_at, pause};
}

// Sends messages of `packets` at 10 Hz over a link, as the endpoint does: at the pace asked for,
// reports after every 16 packets, a round trip later.
struct Loop {
  RateEstimator estimator;
  TimePoint now = at(0s);
  std::uint64_t next_id = 1;

  void message(std::uint32_t packets, DataRate link, double stretch = 1.0) {
    const DataRate pace = estimator.pace().value_or(mbit(20));
    const DataRate arrives = std::min(pace, link).scaled(1 / stretch);
    for (std::uint32_t seen = 16; seen <= packets; seen += 16) {
      const TimePoint told = now + 30ms + arrives.transmit_time(seen * kPacketBytes);
      estimator.train(told, train_of(next_id, seen, arrives, pace));
    }
    next_id += packets;
    now += std::max<Duration>(100ms, arrives.transmit_time(packets * kPacketBytes) + 60ms);
  }
  double rate() const { return estimator.rate().value_or(DataRate{}).mbit(); }
};

TEST(RateEstimator, AStepIsDisputedUntilOneMoreTrainSettlesIt) {
  Loop loop;
  for (int i = 0; i < 4; ++i) loop.message(94, mbit(50));
  EXPECT_FALSE(loop.estimator.disputed());
  loop.message(94, mbit(15));
  EXPECT_TRUE(loop.estimator.disputed());
  EXPECT_NEAR(loop.rate(), 50, 1);
  loop.message(94, mbit(15));
  EXPECT_FALSE(loop.estimator.disputed());
  EXPECT_NEAR(loop.rate(), 15, 1);
}

TEST(RateEstimator, TrainsThatNeverAgreeAreDisputedOnceOnly) {
  Loop loop;
  for (int i = 0; i < 4; ++i) loop.message(94, mbit(50));
  loop.message(94, mbit(15));
  EXPECT_TRUE(loop.estimator.disputed());
  loop.message(94, mbit(30));
  EXPECT_FALSE(loop.estimator.disputed());
}

TEST(RateEstimator, KnowsNothingAtFirst) {
  const RateEstimator e;
  EXPECT_FALSE(e.rate());
  EXPECT_FALSE(e.pace());
  EXPECT_FALSE(e.measured_at());
  EXPECT_EQ(e.trains(), 0U);
}

TEST(RateEstimator, FollowsAStepWithinThreeMessagesBothWays) {
  for (const std::uint32_t packets : {94U, 375U}) {
    for (const double from : {5.0, 10.0, 30.0, 60.0}) {
      for (const double factor : {3.0, 2.0, 1.5, 1.2, 0.8, 0.5, 0.33, 0.2}) {
        if (from * factor > 200) continue;
        Loop loop;
        for (int i = 0; i < 12; ++i) loop.message(packets, mbit(from));
        EXPECT_NEAR(loop.rate(), from, 0.1 * from) << packets << " packets";
        for (int i = 0; i < 3; ++i) loop.message(packets, mbit(from * factor));
        EXPECT_NEAR(loop.rate(), from * factor, 0.1 * from * factor)
            << from << " times " << factor << ", " << packets << " packets";
      }
    }
  }
}

TEST(RateEstimator, OneTrainMovesNothing) {
  for (const double stretch : {0.05, 0.3, 3.0, 20.0}) {
    Loop loop;
    for (int i = 0; i < 6; ++i) loop.message(100, mbit(20));
    const double before = loop.rate();
    loop.message(100, mbit(20), stretch);
    EXPECT_NEAR(loop.rate(), before, 0.02 * before) << stretch;
    loop.message(100, mbit(20));
    EXPECT_NEAR(loop.rate(), before, 0.02 * before) << stretch;
  }
}

TEST(RateEstimator, PacesAboveTheEstimateAndFurtherAfterATrainThatItLimited) {
  RateEstimator e;
  e.train(at(1s), train_of(1, 100, mbit(10), mbit(20)));
  EXPECT_EQ(e.pace(), mbit(12.5));
  e.train(at(3s), train_of(200, 100, mbit(12), mbit(12.5)));
  EXPECT_EQ(e.pace(), mbit(36));
  EXPECT_EQ(e.rate(), mbit(10)) << "of two the lower";
  e.train(at(5s), train_of(400, 100, mbit(12), mbit(30)));
  EXPECT_EQ(e.pace(), e.rate()->scaled(1.25));
}

TEST(RateEstimator, ASlowSenderDoesNotMakeTheLinkSlow) {
  RateEstimator e;
  for (std::uint64_t id = 1; id < 400; id += 100)
    e.train(at(1s), train_of(id, 100, mbit(50), std::nullopt));
  for (std::uint64_t id = 1000; id < 3000; id += 100)
    e.train(at(2s), train_of(id, 100, mbit(5), mbit(5)));
  EXPECT_EQ(e.rate(), mbit(50));
}

TEST(RateEstimator, ShortTrainsCountWhileNothingBetterIsThere) {
  RateEstimator e;
  e.train(at(1s), train_of(1, 15, mbit(90), std::nullopt));
  EXPECT_FALSE(e.rate());
  e.train(at(1s), train_of(1, 16, mbit(90), std::nullopt));  // 1.9 ms
  EXPECT_EQ(e.rate(), mbit(90));
  EXPECT_EQ(e.trains(), 0U);
  e.train(at(2s), train_of(100, 88, mbit(60), std::nullopt));  // 16 ms
  EXPECT_EQ(e.rate(), mbit(60));
  EXPECT_EQ(e.trains(), 1U);
  for (std::uint64_t id = 200; id < 210; ++id)
    e.train(at(3s), train_of(id, 16, mbit(400), std::nullopt));
  EXPECT_EQ(e.rate(), mbit(60));
  EXPECT_EQ(e.measured_at(), at(2s));
}

// A packet of 1428 bytes takes 11 ms at 1 Mbit/s.
TEST(RateEstimator, FewPacketsCountWhereTheyTakeLong) {
  for (const double rate : {0.1, 0.2, 0.5, 1.0}) {
    RateEstimator e;
    e.train(at(1s), train_of(1, 4, mbit(rate), mbit(75)));
    EXPECT_EQ(e.rate(), mbit(rate));
    EXPECT_EQ(e.trains(), 1U);
  }
  RateEstimator e;
  e.train(at(1s), train_of(1, 4, mbit(4), mbit(75)));  // 8.6 ms: a grant of the radio
  EXPECT_FALSE(e.rate());
  EXPECT_FALSE(e.pace());
}

TEST(RateEstimator, AStepToALowRateIsFollowedWithinTwoTrainsOfFewPackets) {
  for (const double rate : {0.1, 0.2, 0.5, 1.0}) {
    Loop loop;
    for (int i = 0; i < 4; ++i) loop.message(94, mbit(60));
    EXPECT_NEAR(loop.rate(), 60, 1);
    for (std::uint64_t id : {10'000U, 11'000U})
      loop.estimator.train(at(2s), train_of(id, 3, mbit(rate), mbit(75)));
    EXPECT_NEAR(loop.rate(), rate, 0.01);
  }
}

// Four messages of one packet each, 20 ms apart, of which the last is 30 ms late.
TEST(RateEstimator, WhatWasSentNowAndThenIsNoSlowLink) {
  RateEstimator e;
  for (std::uint64_t id = 1; id < 400; id += 100)
    e.train(at(1s), train_of(id, 100, mbit(50), std::nullopt));
  const DataRate pace = *e.pace();
  for (std::uint64_t id = 1000; id < 3000; id += 100) {
    const std::size_t bytes = 3 * kPacketBytes;
    e.train(at(2s), train_of(id, 4, rate_of(bytes, 90ms), rate_of(bytes, 60ms), 20ms));
  }
  // Every other one was lost.
  Train lossy =
      train_of(5000, 5, rate_of(4 * kPacketBytes, 800ms), rate_of(8 * kPacketBytes, 800ms), 100ms);
  lossy.left = 9;
  lossy.bytes = 8 * kPacketBytes;
  for (int i = 0; i < 3; ++i, ++lossy.id) e.train(at(2s), lossy);
  EXPECT_EQ(e.rate(), mbit(50));
  EXPECT_EQ(e.pace(), pace);
  EXPECT_EQ(e.measured_at(), at(1s));
}

// 32 packets that a late receiver found and stamped at once look like 2.5 to 3.9 Gbit/s.
// Messages of three packets, ten a second, on a link of which nothing is known: they were no slower
// than they were sent.
TEST(RateEstimator, WhatAnApplicationHappensToSendIsNoRateByItself) {
  RateEstimator estimator;
  for (std::uint64_t i = 0; i < 20; ++i) {
    estimator.train(at(std::int64_t(i) * 100ms), train_of(1 + i, 3, mbit(0.1), mbit(0.1), 100ms));
    EXPECT_FALSE(estimator.rate());
    EXPECT_FALSE(estimator.pace());
  }
  estimator.train(at(3s), train_of(30, 100, mbit(50), mbit(400)));
  EXPECT_NEAR(estimator.rate()->mbit(), 50, 0.1);
}

TEST(RateEstimator, ABatchIsNoRateButHowFastToSearch) {
  RateEstimator e;
  e.train(at(1s), train_of(1, 32, mbit(3'900), std::nullopt));
  EXPECT_FALSE(e.rate());
  EXPECT_FALSE(e.measured_at());
  EXPECT_EQ(e.trains(), 0U);
  EXPECT_EQ(e.guess(), mbit(3'900));
  EXPECT_EQ(e.pace(), mbit(3'900 * 1.25));
  for (int i = 0; i < 3; ++i) e.sample(at(1s), {mbit(4'000), false});
  EXPECT_FALSE(e.rate());

  e.train(at(2s), train_of(100, 64, mbit(100), std::nullopt));  // 7 ms
  EXPECT_EQ(e.rate(), mbit(100));
  EXPECT_EQ(e.guess(), e.rate());
  EXPECT_EQ(e.measured_at(), at(2s));
  e.train(at(3s), train_of(200, 32, mbit(3'900), std::nullopt));
  EXPECT_EQ(e.rate(), mbit(100));
  EXPECT_EQ(e.guess(), e.rate());
}

TEST(RateEstimator, ATrainIsBelievedFromAMillisecondOn) {
  for (const std::uint32_t packets : {16U, 32U, 59U}) {
    const DataRate limit = rate_of((packets - 1) * kPacketBytes, RateEstimator::kLeastDispersion);
    RateEstimator slower;
    slower.train(at(1s), train_of(1, packets, limit.scaled(0.99), std::nullopt));
    EXPECT_TRUE(slower.rate()) << packets;
    RateEstimator faster;
    faster.train(at(1s), train_of(1, packets, limit.scaled(1.01), std::nullopt));
    EXPECT_FALSE(faster.rate()) << packets;
  }
}

TEST(RateEstimator, ALongTrainIsBelievedHoweverFast) {
  RateEstimator e;
  e.train(at(1s), train_of(1, RateEstimator::kLongTrain, mbit(40'000), std::nullopt));
  EXPECT_EQ(e.rate(), mbit(40'000));
  EXPECT_EQ(e.trains(), 0U);
}

TEST(RateEstimator, ACompressedTrainShowsWhatItWasSentAt) {
  RateEstimator e;
  e.train(at(1s), train_of(1, 32, mbit(3'900), mbit(60)));  // it took us 6 ms to send
  EXPECT_EQ(e.rate(), mbit(60));
  EXPECT_EQ(e.trains(), 0U);
}

TEST(RateEstimator, ATrainToldTwiceCountsOnce) {
  RateEstimator e;
  for (std::uint64_t id = 1; id < 300; id += 100)
    e.train(at(1s), train_of(id, 100, mbit(30), mbit(90)));
  for (int i = 0; i < 10; ++i) e.train(at(2s), train_of(500, 100, mbit(3), mbit(90)));
  EXPECT_EQ(e.rate(), mbit(30));
  EXPECT_EQ(e.measured_at(), at(2s));
}

TEST(RateEstimator, DeliverySamplesOnlyRaise) {
  RateEstimator e;
  for (int i = 0; i < 5; ++i) e.sample(at(1s), {mbit(5), true});
  EXPECT_FALSE(e.rate()) << "what an application happened to send is no rate of the link";
  for (std::uint64_t id = 1; id < 300; id += 100)
    e.train(at(1s), train_of(id, 100, mbit(30), mbit(90)));
  for (int i = 0; i < 5; ++i) e.sample(at(2s), {mbit(10), false});
  EXPECT_EQ(e.rate(), mbit(30));
  e.sample(at(3s), {mbit(40), true});
  EXPECT_EQ(e.rate(), mbit(30)) << "one alone moves nothing";
  e.sample(at(3s), {mbit(41), true});
  EXPECT_EQ(e.rate(), mbit(40));
  e.train(at(4s), train_of(500, 100, mbit(30), mbit(90)));
  EXPECT_EQ(e.rate(), mbit(30)) << "trains know better";
}

TEST(RateEstimator, TheCapHoldsForEstimateAndPace) {
  RateEstimator e;
  for (std::uint64_t id = 1; id < 300; id += 100)
    e.train(at(1s), train_of(id, 100, mbit(30), mbit(90)));
  e.set_cap(mbit(20));
  EXPECT_EQ(e.rate(), mbit(20));
  EXPECT_EQ(e.pace(), mbit(20));
  e.set_cap(std::nullopt);
  EXPECT_EQ(e.rate(), mbit(30));
}

}  // namespace
}  // namespace interneuron::link::rate_estimator_test
