#include "core/flow/arrivals.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <set>

namespace interneuron::flow::path_receiver_test {
namespace {

using namespace std::chrono_literals;

constexpr LinkId kLink{3};
constexpr std::size_t kPacket = 1428;

TimePoint at(Duration d) { return TimePoint{d}; }

constexpr PathReceiver::Role kData = PathReceiver::Role::kData;

bool accept(PathReceiver& r, std::uint64_t number) {
  return r.accept(at(1s), number, kData, kPacket);
}

TEST(PathReceiver, AcceptsEachNumberOnce) {
  PathReceiver r(kLink);
  EXPECT_TRUE(accept(r, 5));
  EXPECT_FALSE(accept(r, 5));
  EXPECT_TRUE(accept(r, 3));
  EXPECT_FALSE(accept(r, 3));
  EXPECT_TRUE(accept(r, 6));
  EXPECT_FALSE(accept(r, 5));
}

// ECN (RFC 3168): ECT(0) is 2, ECT(1) 1, a mark 3.
TEST(PathReceiver, CountsMarksOfWhatItAccepts) {
  PathReceiver r(kLink);
  std::uint64_t number = 0;
  for (const int ecn : {0, 1, 2, 3, 3, 0}) {
    r.accept(at(1s), ++number, kData, kPacket, static_cast<std::uint8_t>(ecn));
  }
  r.accept(at(1s), 4, kData, kPacket, 3);
  EXPECT_EQ(r.report(at(1s)).ect0_packets, 1U);
  EXPECT_EQ(r.report(at(1s)).ect1_packets, 1U);
  EXPECT_EQ(r.report(at(1s)).ce_packets, 2U);
}

TEST(PathReceiver, WhatIsOlderThanItsWindowIsRefused) {
  PathReceiver r(kLink);
  accept(r, 1000);
  EXPECT_TRUE(accept(r, 1000 - wire::kAckWindow));
  EXPECT_FALSE(accept(r, 1000 - wire::kAckWindow - 1));
}

TEST(PathReceiver, AJumpBeyondTheWindowForgetsWhatWasBefore) {
  PathReceiver r(kLink);
  accept(r, 1);
  accept(r, UINT64_MAX);
  EXPECT_FALSE(accept(r, 1));
  EXPECT_FALSE(accept(r, UINT64_MAX));
  EXPECT_EQ(r.report(at(1s)).largest, UINT64_MAX);
  EXPECT_EQ(r.report(at(1s)).bitmap, wire::AckBitmap{});
}

RC_GTEST_PROP(PathReceiver, AgreesWithASet, ()) {
  PathReceiver r(kLink);
  std::set<std::uint64_t> seen;
  std::uint64_t largest = 0;
  const auto steps = *rc::gen::container<std::vector<int>>(
      rc::gen::oneOf(rc::gen::inRange(-20, 20), rc::gen::inRange(-300, 300)));
  std::int64_t last = 1000;
  for (const int step : steps) {
    last = std::max<std::int64_t>(1, last + step);
    const auto number = static_cast<std::uint64_t>(last);
    const bool too_old = number + wire::kAckWindow < largest;
    RC_ASSERT(accept(r, number) == (!too_old && !seen.contains(number)));
    if (!too_old) seen.insert(number);
    largest = std::max(largest, number);
  }
  const wire::LinkReport report = r.report(at(1s));
  RC_ASSERT(report.link == kLink);
  RC_ASSERT(report.largest == largest);
  for (std::uint64_t i = 0; i < wire::kAckWindow; ++i) {
    const bool said = (report.bitmap[i / 64] >> (i % 64) & 1U) != 0;
    RC_ASSERT(said == (largest > i && seen.contains(largest - 1 - i)));
  }
}

TEST(PathReceiver, ASkippedNumberIsAGapUntilItIsReported) {
  PathReceiver r(kLink);
  accept(r, 9);  // the first one skips nothing
  accept(r, 10);
  EXPECT_FALSE(r.gap());
  accept(r, 12);
  EXPECT_TRUE(r.gap());
  r.reported();
  EXPECT_FALSE(r.gap());
  accept(r, 11);  // only late
  EXPECT_FALSE(r.gap());
}

TEST(PathReceiver, ATrainIsMeasuredFromItsSecondPacketOn) {
  PathReceiver r(kLink);
  const Duration step = 114'240ns;  // 1428 bytes at 100 Mbit/s
  for (int i = 0; i < 20; ++i) {
    r.accept(at(1s + i * step), 50 + static_cast<std::uint64_t>(i), kData, kPacket);
  }
  const wire::LinkReport report = r.report(at(2s));
  EXPECT_EQ(report.train_start, 50U);
  EXPECT_EQ(report.train_packets, 20U);
  EXPECT_NEAR(report.train_rate.mbit(), 100, 0.01);
}

// Packets of one train, `step` apart, beginning with `number`; returns when the next one is due.
TimePoint arrive(PathReceiver& r, TimePoint now, Duration step, std::uint64_t number,
                 std::uint32_t packets, PathReceiver::Role role = kData) {
  for (std::uint32_t i = 0; i < packets; ++i, now += step) r.accept(now, number + i, role, kPacket);
  return now;
}

TEST(PathReceiver, APauseOrTooLongATrainBeginsAnother) {
  PathReceiver r(kLink);
  TimePoint now = arrive(r, at(0ms), 2ms, 1, 4);  // 6 ms long
  r.accept(now + 8ms, 5, kData, kPacket);
  EXPECT_EQ(r.report(at(1s)).train_start, 1U);
  r.accept(now + 24ms + 1ns, 6, kData, kPacket);
  EXPECT_EQ(r.report(at(1s)).train_start, 6U);
  EXPECT_EQ(r.report(at(1s)).train_rate, DataRate{});
  arrive(r, at(1s), 5ms, 7, 50);
  EXPECT_EQ(r.report(at(2s)).train_start, 48U);  // the first more than 200 ms after packet 7
}

TEST(PathReceiver, ASlowLinkIsMeasuredFromThePacketsOfOneMessage) {
  for (const double mbit : {0.1, 0.2, 0.5, 1.0, 1.2}) {
    PathReceiver r(kLink);
    const Duration step = DataRate::mbit(mbit).transmit_time(kPacket);
    arrive(r, at(0s), step, 1, 6);
    const wire::LinkReport report = r.report(at(2s));
    EXPECT_EQ(report.train_start, 1U) << mbit;
    EXPECT_EQ(report.train_packets, 6U) << mbit;
    EXPECT_NEAR(report.train_rate.mbit(), mbit, 0.01 * mbit);
  }
}

TEST(PathReceiver, ATrainOfASlowLinkEndsWithinASecond) {
  PathReceiver r(kLink);
  const TimePoint end = arrive(r, at(0s), 114ms, 1, 60);
  EXPECT_GE(r.report(end).train_start, 60U - 10);
  PathReceiver faster(kLink);
  arrive(faster, at(0s), 23ms, 1, 60);
  EXPECT_GE(faster.report(end).train_start, 60U - 10);
}

// A message of one packet, and 90 ms later one of many.
TEST(PathReceiver, WhatComesAloneIsNoPartOfTheTrainAfterIt) {
  for (const std::uint32_t alone : {1U, 2U, 3U, 9U}) {
    PathReceiver r(kLink);
    arrive(r, at(0s), 200us, 1, alone);
    arrive(r, at(90ms), 200us, 1 + alone, 40);
    const wire::LinkReport report = r.report(at(1s));
    EXPECT_EQ(report.train_start, 1U + alone);
    EXPECT_NEAR(report.train_rate.mbit(), kPacket * 8.0 / 200, 0.1);
  }
}

TEST(PathReceiver, WhatComesNowAndThenIsNoPartOfTheTrainAfterIt) {
  PathReceiver r(kLink);
  const TimePoint now = arrive(r, at(0s), 50ms, 1, 4);
  arrive(r, now - 30ms, 640us, 5, 10);
  EXPECT_EQ(r.report(at(1s)).train_start, 5U);
}

// A radio that holds up packets once is no slow link, and one that delivers two at once is.
TEST(PathReceiver, OneLongGapMakesNoRate) {
  PathReceiver r(kLink);
  TimePoint now = arrive(r, at(0s), 200us, 1, 3);
  arrive(r, now + 30ms, 200us, 4, 3);
  EXPECT_EQ(r.report(at(1s)).train_rate, DataRate{});
  PathReceiver pairs(kLink);
  now = at(0s);
  for (std::uint64_t n = 1; n < 9; n += 2, now += 24ms) arrive(pairs, now, 0ms, n, 2);
  EXPECT_NEAR(pairs.report(at(1s)).train_rate.mbit(), kPacket * 8 * 7 / 72e3, 0.01);
}

// A train at 1 Gbit/s among messages of four packets every 10 ms.
TEST(PathReceiver, ProbesAmongMessagesAreATrainOfTheirOwn) {
  PathReceiver r(kLink);
  const Duration step = 11'424ns;
  for (std::uint32_t i = 0; i < 10; ++i) arrive(r, at(i * 10ms), step, 1 + 4 * i, 4);
  TimePoint now = arrive(r, at(100ms), step, 41, 4);
  now = arrive(r, now, step, 45, 32, PathReceiver::Role::kProbe);
  // A message may lie within it.
  now = arrive(r, now, step, 77, 4);
  arrive(r, now, step, 81, 32, PathReceiver::Role::kProbe);
  EXPECT_EQ(r.report(at(101ms)).train_start, 45U);
  EXPECT_EQ(r.report(at(101ms)).train_packets, 68U);
  EXPECT_NEAR(r.report(at(101ms)).train_rate.mbit(), 1000, 1);
  arrive(r, at(110ms), step, 113, 4);
  EXPECT_EQ(r.report(at(111ms)).train_start, 113U);
}

// Packets of one train that leave `sent` apart and arrive `step` apart, as many numbers apart as
// `numbers`; returns when the next one is due.
struct Paced {
  PathReceiver receiver{kLink};
  TimePoint now = at(1s);
  Duration left = 0s;
  std::uint64_t number = 1;
  void arrive(int packets, Duration sent, Duration step, std::uint64_t numbers = 1) {
    for (int i = 0; i < packets; ++i, now += step, number += numbers) {
      const auto us = std::chrono::floor<std::chrono::microseconds>(left).count();
      receiver.accept(now, number, kData, kPacket, 0, false, static_cast<std::uint32_t>(us));
      left += sent * static_cast<std::int64_t>(numbers);
    }
  }
  double mbit() const { return receiver.report(now).train_rate.mbit(); }
};

TEST(PathReceiver, APacketOfASlowLinkIsNoGrant) {
  for (const double mbit : {0.5, 1.0, 2.0}) {
    Paced paced;
    paced.arrive(6, 1ms, DataRate::mbit(mbit).transmit_time(kPacket));
    EXPECT_NEAR(paced.mbit(), mbit, 0.01 * mbit);
  }
}

// A bucket lets 50 packets pass as they left, and then one each millisecond: a shaper lets the
// others wait, and a policer drops nine of ten.
TEST(PathReceiver, ABucketThatRanEmptyTellsAtWhatRateItFills) {
  Paced shaped;
  shaped.arrive(50, 100us, 100us);
  EXPECT_NEAR(shaped.mbit(), kPacket * 8.0 / 100, 0.1);
  shaped.arrive(10, 100us, 1ms);
  EXPECT_NEAR(shaped.mbit(), kPacket * 8.0 / 1000, 0.1);
  Paced policed;
  policed.arrive(50, 100us, 100us);
  policed.arrive(10, 100us, 1ms, 10);
  EXPECT_NEAR(policed.mbit(), kPacket * 8.0 / 1000, 0.1);
}

// It is the sender who is slow at the end.
TEST(PathReceiver, ATrainThatLeavesMoreSlowlyAtItsEndHasFoundNoBucket) {
  Paced paced;
  paced.arrive(50, 100us, 100us);
  paced.arrive(10, 1ms, 1ms);
  EXPECT_NEAR(paced.mbit(), kPacket * 8.0 * 59 / 14'000, 0.1);
}

TEST(PathReceiver, FeedbackIsNoPartOfATrain) {
  PathReceiver r(kLink);
  r.accept(at(0ms), 1, PathReceiver::Role::kNone, kPacket);
  EXPECT_EQ(r.report(at(1s)).train_packets, 0U);
  EXPECT_EQ(r.report(at(1s)).largest, 1U);
}

TEST(PathReceiver, ReportsTheNewestExchangeAndItsAge) {
  PathReceiver r(kLink);
  EXPECT_FALSE(r.report(at(1s)).has_exchange);
  r.exchange(at(1s), PeerTime{500ms});
  r.exchange(at(1100ms), PeerTime{400ms});  // overtaken
  const wire::LinkReport report = r.report(at(1250ms));
  EXPECT_TRUE(report.has_exchange);
  EXPECT_EQ(report.s, PeerTime{500ms});
  EXPECT_EQ(report.h, 250ms);
}

}  // namespace
}  // namespace interneuron::flow::path_receiver_test
