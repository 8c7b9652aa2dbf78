// A message that is overdue is told to be incomplete only where that is certain.
#include "core/flow/overdue.h"

#include <gtest/gtest.h>

namespace interneuron::flow::overdue_test {
namespace {

using namespace std::chrono_literals;

constexpr LinkId kA{0};
constexpr LinkId kB{1};
constexpr MessageId kMessage{7};
constexpr SentPackets::Piece kPiece{kMessage, 3};

TimePoint at(Duration d) { return TimePoint{d}; }

wire::LinkReport report(LinkId path, std::uint64_t largest, std::uint64_t bytes = 0) {
  return wire::LinkReport{
      .link = path, .largest = largest, .received_bytes = bytes != 0 ? bytes : 1000 * largest};
}

// With a deadline at 1 s, and copies of one piece.
Overdue overdue(const Overdue::Paths& copies) {
  Overdue out;
  out.add(at(1s), kPiece, at(1s), copies);
  return out;
}

TEST(Overdue, WhatNeverLeftIsIncompleteAtOnce) {
  Overdue o = overdue({});
  EXPECT_EQ(o.poll(), kMessage);
  EXPECT_FALSE(o.poll());
}

TEST(Overdue, AReportOfAfterTheDeadlineTells) {
  Overdue o = overdue({{kA, 50}});
  o.report(report(kA, 60), at(1s - 1ns));
  o.report(report(kA, 60), std::nullopt);
  o.report(report(kB, 60), at(2s));
  EXPECT_FALSE(o.poll());
  o.report(report(kA, 60), at(1s));
  EXPECT_EQ(o.poll(), kMessage);
}

TEST(Overdue, EveryPathThatCarriedACopyHasToTellHoweverOftenOthersDo) {
  Overdue o = overdue({{kA, 50}, {kB, 9}});
  for (int i = 0; i < 8; ++i) o.report(report(kA, 60), at(2s));
  EXPECT_FALSE(o.poll());
  o.report(report(kB, 60), at(2s));
  EXPECT_EQ(o.poll(), kMessage);
}

TEST(Overdue, HoweverManyOvertakeAPacketItMayStillComeBeforeTheDeadline) {
  Overdue o = overdue({{kA, 50}});
  o.report(report(kA, 50 + wire::kAckWindow), std::nullopt);
  o.report(report(kA, 50 + wire::kAckWindow), at(1s - 1ns));
  EXPECT_FALSE(o.poll());
}

TEST(Overdue, AReportThatTellsNoMoreOfACopyTellsNothing) {
  Overdue o = overdue({{kA, 50}});
  o.report(report(kA, 50 + wire::kAckWindow + 1), at(2s));
  o.report(report(kA, 60), at(2s));
  EXPECT_FALSE(o.poll());
  Overdue just = overdue({{kA, 50}});
  just.report(report(kA, 50 + wire::kAckWindow), at(2s));
  EXPECT_EQ(just.poll(), kMessage);
}

TEST(Overdue, NothingIsToldOfAPieceThatHasArrivedAfterAll) {
  Overdue o = overdue({{kA, 50}});
  o.arrived({kMessage, 2});
  o.arrived({MessageId{8}, 3});
  o.arrived(kPiece);
  o.report(report(kA, 60), at(2s));
  EXPECT_FALSE(o.poll());
}

TEST(Overdue, NorWhereAPathWasRemovedOrThePeerHasForgottenIt) {
  Overdue removed = overdue({{kA, 50}, {kB, 9}});
  removed.report(report(kA, 60), at(2s));
  removed.remove_path(kB);
  removed.report(report(kB, 60), at(2s));
  EXPECT_FALSE(removed.poll());
  Overdue forgotten = overdue({{kA, 50}});
  forgotten.report(report(kA, 40, 40'000), at(900ms));
  forgotten.report(report(kA, 60, 1'000), at(2s));
  EXPECT_FALSE(forgotten.poll());
  // An older report that comes later means nothing.
  Overdue swapped = overdue({{kA, 50}});
  swapped.report(report(kA, 40, 40'000), at(900ms));
  swapped.report(report(kA, 30, 30'000), at(800ms));
  swapped.report(report(kA, 60, 60'000), at(2s));
  EXPECT_EQ(swapped.poll(), kMessage);
}

TEST(Overdue, IsBoundedAndForgetsWhatIsOld) {
  Overdue o;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    o.add(at(1s), {MessageId{i}, 0}, at(1s), {{kA, 50}});
  }
  o.report(report(kA, 60), at(1s));
  std::size_t told = 0;
  while (o.poll()) ++told;
  EXPECT_EQ(told, 1024U);
  o.add(at(1s), kPiece, at(1s), {{kA, 50}});
  o.add(at(5s), {MessageId{8}, 0}, at(5s), {{kA, 90}});
  o.report(report(kA, 95), at(6s));
  EXPECT_EQ(o.poll(), MessageId{8});
  EXPECT_FALSE(o.poll());
}

}  // namespace
}  // namespace interneuron::flow::overdue_test
