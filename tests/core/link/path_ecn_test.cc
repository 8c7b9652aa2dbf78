#include "core/link/path_ecn.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace interneuron::link::path_ecn_test {
namespace {

using namespace std::chrono_literals;

// A path, and the counts of the peer at its other end.
struct Told {
  PathEcn ecn;
  TimePoint now{1h};
  std::uint64_t largest = 0;
  std::uint16_t ect0 = 0;
  std::uint32_t ect = 0;
  std::uint32_t ce = 0;
  // So many packets arrive and are told of; of each what the peer counts.
  PathEcn::Told arrive(std::uint32_t unmarked, std::uint32_t marked, std::uint32_t bare = 0) {
    const std::uint32_t all = unmarked + marked + bare;
    largest += all;
    ect += unmarked;
    ce += marked;
    now += 50ms;
    return ecn.report(now, {largest, ect0, ect, ce, all, now - 40ms});
  }
};

TEST(PathEcn, WorksOnceEnoughHasArrivedAsItLeft) {
  Told t;
  EXPECT_EQ(t.ecn.bits(), kEct1);
  t.arrive(9, 0);
  EXPECT_EQ(t.ecn.state(), EcnState::kTesting);
  const auto told = t.arrive(3, 2);
  EXPECT_EQ(told.arrived, 5U);
  EXPECT_EQ(told.marked, 2U);
  EXPECT_EQ(t.ecn.state(), EcnState::kWorks);
  EXPECT_EQ(t.ecn.bits(), kEct1);
}

TEST(PathEcn, WhatComesWithoutBitsIsBleached) {
  for (const std::uint32_t before : {0U, 50U}) {
    Told t;
    if (before > 0) t.arrive(before, 0);
    const auto told = t.arrive(4, 2, 1);
    EXPECT_EQ(t.ecn.state(), EcnState::kBleached);
    EXPECT_EQ(t.ecn.bits(), kNotEct);
    EXPECT_EQ(told.marked, 0U);
    // Marks count for nothing from then on.
    EXPECT_EQ(t.arrive(0, 5).marked, 0U);
  }
}

// Nothing is missing in the sum of both counts.
TEST(PathEcn, WhatComesWithTheOtherBitIsRewritten) {
  for (const std::uint32_t before : {0U, 50U}) {
    Told t;
    if (before > 0) t.arrive(before, 0);
    t.ect0 = 7;
    t.arrive(0, 0, 7);
    EXPECT_EQ(t.ecn.state(), EcnState::kRewritten);
    EXPECT_EQ(t.ecn.bits(), kNotEct);
    // Where the path leads elsewhere it is tested anew, and what was counted before is forgotten.
    t.ecn.moved();
    t.arrive(20, 0);
    EXPECT_EQ(t.ecn.state(), EcnState::kWorks);
  }
}

// More may be counted than is acknowledged: reports tell of the newest packets only.
TEST(PathEcn, AcknowledgementsThatAreMissingAreNoFault) {
  Told t;
  t.ecn.report(t.now, {100, 0, 100, 0, 20, t.now});
  EXPECT_EQ(t.ecn.state(), EcnState::kWorks);
}

TEST(PathEcn, AReportThatWasOvertakenTellsNothing) {
  Told t;
  t.arrive(20, 0);
  const auto told = t.ecn.report(t.now, {t.largest - 5, 0, t.ect - 5, 0, 0, t.now});
  EXPECT_EQ(told.arrived, 0U);
  EXPECT_EQ(t.arrive(1, 0).arrived, 1U);
  EXPECT_EQ(t.ecn.state(), EcnState::kWorks);
}

TEST(PathEcn, APeerThatCountsAnewIsNotBleaching) {
  Told t;
  t.arrive(500, 3);
  t.ect = t.ce = 0;
  t.arrive(2, 0);
  EXPECT_EQ(t.arrive(7, 1).marked, 1U);
  EXPECT_EQ(t.ecn.bits(), kEct1);
}

TEST(PathEcn, APathThatMovedIsTestedAnewAndOldMarksAreNotToldAgain) {
  Told t;
  t.arrive(50, 20);
  t.arrive(0, 0, 5);
  ASSERT_EQ(t.ecn.state(), EcnState::kBleached);
  t.ecn.moved();
  EXPECT_EQ(t.ecn.state(), EcnState::kTesting);
  const auto told = t.arrive(10, 1);
  EXPECT_EQ(told.arrived, 11U);
  EXPECT_EQ(told.marked, 1U);
  EXPECT_EQ(t.ecn.state(), EcnState::kWorks);
}

TEST(PathEcn, CountsGoRoundAt32Bits) {
  Told t;
  t.ecn.report(t.now, {1, 0, 0x7fff'ffff, 0, 1, t.now});
  t.ecn.report(t.now, {2, 0, 0xffff'fffe, 0, 1, t.now});
  const auto told = t.ecn.report(t.now, {20, 0, 5, 1, 8, t.now});
  EXPECT_EQ(told.arrived, 8U);
  EXPECT_EQ(told.marked, 1U);
}

TEST(PathEcn, MarksWithoutEndAreNobodysQueue) {
  Told t;
  t.arrive(20, 0);
  const TimePoint from = t.now;
  while (t.ecn.state() == EcnState::kWorks) {
    ASSERT_LT(t.now - from, 3s);
    t.arrive(0, 2);
  }
  EXPECT_EQ(t.ecn.state(), EcnState::kMangled);
  EXPECT_GE(t.now - from, PathEcn::kMangled);
  EXPECT_EQ(t.ecn.bits(), kNotEct);
}

TEST(PathEcn, OnePacketWithoutAMarkIsEnoughToBelieveThem) {
  Told t;
  for (int i = 0; i < 200; ++i) {
    t.arrive(i % 20 == 0 ? 1 : 0, 5);
    ASSERT_EQ(t.ecn.bits(), kEct1);
  }
}

// Packets with ECT and without leave every 50 ms, and none of the first arrives until `until`.
EcnState dropping(Duration until) {
  PathEcn ecn;
  const TimePoint from{1h};
  std::uint32_t arrived = 0;
  for (TimePoint now = from; now < from + 5s; now += 50ms) {
    ecn.sent(now);
    const std::uint32_t newly = now - from < until ? 0 : 1;
    arrived += newly;
    const auto number = static_cast<std::uint64_t>((now - from) / 1ms);
    ecn.report(now + 20ms, {number + 1, 0, arrived, 0, newly, now + 1ms});
  }
  return ecn.state();
}

TEST(PathEcn, ThePathMayDropWhatMayBeMarked) {
  EXPECT_EQ(dropping(5s), EcnState::kDropped);
  // An outage at the start takes what has no ECT as well, and is over soon.
  EXPECT_EQ(dropping(900ms), EcnState::kWorks);
  // Nothing was heard of any packet since.
  PathEcn ecn;
  const TimePoint from{1h};
  for (int i = 0; i < 100; ++i) ecn.sent(from + i * 50ms);
  ecn.report(from + 5s, {1, 0, 0, 0, 0, from - 1s});
  EXPECT_EQ(ecn.state(), EcnState::kTesting);
}

RC_GTEST_PROP(PathEcn, NeverTellsMoreMarksThanPackets, ()) {
  PathEcn ecn;
  TimePoint now{1h};
  const auto steps = *rc::gen::inRange(1, 60);
  for (int i = 0; i < steps; ++i) {
    now += std::chrono::milliseconds(*rc::gen::inRange(0, 500));
    const auto told = ecn.report(
        now, {*rc::gen::arbitrary<std::uint16_t>(), *rc::gen::inRange<std::uint16_t>(0, 2),
              *rc::gen::arbitrary<std::uint32_t>(), *rc::gen::arbitrary<std::uint32_t>(),
              *rc::gen::inRange(0U, 300U), now});
    RC_ASSERT(told.marked <= told.arrived);
    RC_ASSERT(ecn.bits() == kEct1 || told.arrived == 0);
  }
}

}  // namespace
}  // namespace interneuron::link::path_ecn_test
