// What the Sender takes for lost, and where it sends that again.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <set>

#include "sender_support.h"

namespace interneuron::flow::sender_repair_test {
namespace {

// Sends `pieces` on A; returns their numbers.
std::vector<std::uint64_t> sent_on_a(Paths& p, TimePoint& now) {
  std::vector<std::uint64_t> numbers;
  for (const auto& piece : p.drain(kA, now)) numbers.push_back(piece.number);
  return numbers;
}

// The pieces in flight that this report has acknowledged.
std::size_t acknowledged(const SentPackets::Verdicts& verdicts) {
  return static_cast<std::size_t>(std::ranges::count_if(
      verdicts.pieces, [](const auto& piece) { return piece.arrived && piece.was_open; }));
}

TEST(Sender, ThreeLaterPacketsMakeALoss) {
  Paths p;
  p.send(at(0s), kFar, 5, {kA});
  TimePoint now = at(0s);
  ASSERT_EQ(sent_on_a(p, now), (std::vector<std::uint64_t>{1, 2, 3, 4, 5}));
  EXPECT_EQ(acknowledged(p.sender.report(now, report_of(kA, {2, 3}))), 2U);
  EXPECT_EQ(p.sender.lost(kA), 0U);
  EXPECT_EQ(acknowledged(p.sender.report(now, report_of(kA, {2, 3, 4}))), 1U);
  EXPECT_EQ(p.sender.lost(kA), 1U);
  EXPECT_TRUE(p.sender.next_send(kA) || p.sender.next_send(kB));
  EXPECT_EQ(acknowledged(p.sender.report(now, report_of(kA, {2, 3, 4}))), 0U);  // nothing new
  EXPECT_EQ(p.sender.lost(kA), 1U);
}

TEST(Sender, ReportsOfPacketsNeverSentAreVoid) {
  Paths p;
  p.send(at(0s), kFar, 2, {kA});
  TimePoint now = at(0s);
  sent_on_a(p, now);
  for (const auto& r :
       {report_of(kA, {1, 2, 3}), report_of(kA, {UINT64_MAX}), report_of(LinkId{9}, {1})}) {
    const auto v = p.sender.report(now, r);
    EXPECT_EQ(acknowledged(v) + p.sender.lost(kA), 0U);
    EXPECT_TRUE(v.runs.empty());
    EXPECT_FALSE(v.newest_sent);
  }
  EXPECT_EQ(acknowledged(p.sender.report(now, report_of(kA, {1, 2}))), 2U);
}

TEST(Sender, SilenceMakesALossAtTheProbeTimeout) {
  Paths p;
  p.send(at(0s), kFar, 1, {kA});
  ASSERT_TRUE(p.sender.poll(at(0s), kA));
  EXPECT_EQ(p.sender.next_timeout(), at(50ms));
  p.sender.handle_timeout(at(50ms - 1ns));
  EXPECT_EQ(p.sender.lost(kA), 0U);
  p.sender.handle_timeout(at(50ms));
  EXPECT_EQ(p.sender.lost(kA), 1U);
  p.sender.handle_timeout(at(51ms));
  EXPECT_EQ(p.sender.lost(kA), 1U);
}

TEST(Sender, RepairsOnTheSoonerPath) {
  Paths p;
  p.set(kA, 30ms);
  p.set(kB, 20ms);
  p.send(at(0s), kFar, 1, {kA});
  p.sender.poll(at(0s), kA);
  p.sender.handle_timeout(at(50ms));
  EXPECT_FALSE(p.sender.poll(at(50ms), kA));
  const auto again = p.sender.poll(at(50ms), kB);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->fragment.index, 0U);
  EXPECT_EQ(p.sender.resent(kB), 1U);
  EXPECT_EQ(p.sender.resent(kA), 0U);
}

TEST(Sender, AFullQueueMakesAPathLater) {
  Paths p;
  p.set(kB, 5ms);
  p.send(at(0s), kFar, 200, {kB});  // 22 ms of queue
  p.send(at(0s), kFar, 1, {kA});
  p.sender.poll(at(0s), kA);
  p.sender.handle_timeout(at(50ms));
  ASSERT_TRUE(p.sender.poll(at(50ms), kA));
}

TEST(Sender, WhatNobodyWaitsForNoLongerCountsAsQueued) {
  // The same message on both paths: A brings it all while B, polled late, still has it queued. A
  // repair of another message must not think that B is busy, although something else keeps B's
  // queue from running empty.
  Paths p;
  p.set(kB, 5ms);
  p.send(at(0s), at(200ms), 50, {kA, kB});
  TimePoint now = at(0s);
  std::set<std::uint64_t> all;
  for (const auto& piece : p.drain(kA, now)) all.insert(piece.number);
  const MessageId other = p.send(now, kFar, 2, {kB});
  p.sender.report(now, report_of(kA, all));
  const MessageId small = p.send(now, kFar, 1, {kA});
  ASSERT_TRUE(p.sender.poll(now, kA));
  p.sender.handle_timeout(now + 50ms);
  // Expected over B: two pieces ahead of it, 5 ms; over A 10 ms.
  TimePoint then = now + 50ms;
  std::vector<MessageId> order;
  for (const auto& piece : p.drain(kB, then)) order.push_back(piece.fragment.message);
  EXPECT_EQ(order.size(), 3U);
  EXPECT_EQ(std::ranges::count(order, small), 1);
  EXPECT_EQ(std::ranges::count(order, other), 2);
}

TEST(Sender, NothingIsRepairedThatWouldBeTooLate) {
  Paths p;
  p.send(at(0s), at(60ms), 1, {kA});
  p.sender.poll(at(0s), kA);
  p.sender.handle_timeout(at(50ms));  // 50 + 10 ms and the time on the wire
  EXPECT_TRUE(p.idle(at(50ms)));
  EXPECT_EQ(p.sender.cancelled(), 1U);
}

TEST(Sender, NothingIsRepairedWhileAnotherCopyIsSooner) {
  Paths p;
  p.set(kB, 15ms);
  p.send(at(0s), kFar, 1, {kA, kB});
  ASSERT_TRUE(p.sender.poll(at(0s), kA));
  ASSERT_TRUE(p.sender.poll(at(45ms), kB));  // arrives at 60 ms
  p.sender.handle_timeout(at(50ms));         // A's copy is lost; again over A: later than 60 ms
  EXPECT_TRUE(p.idle(at(50ms)));
  EXPECT_EQ(p.sender.cancelled(), 0U);
  p.sender.handle_timeout(at(95ms));  // and so is B's
  EXPECT_TRUE(p.sender.poll(at(95ms), kA));
}

// Paths on which a loss is known within two round trips.
void make_steady(Paths& p, LinkId link, Duration one_way, bool loaded = false) {
  PathView v = view(one_way);
  v.probe_timeout = 3 * one_way;
  v.loaded = loaded;
  p.sender.set_path(link, v);
}

// One more copy leaves over A after 45 ms, and none over B.
void expect_one_copy(Paths& p) {
  EXPECT_TRUE(p.sender.poll(at(45ms), kA));
  EXPECT_TRUE(p.idle(at(45ms)));
}

// Sends a message of five fragments over A, of which the first is reported lost after 45 ms.
void lose_the_first(Paths& p, TimePoint deadline) {
  p.send(at(0s), deadline, 5, {kA});
  TimePoint now = at(0s);
  const auto numbers = sent_on_a(p, now);
  p.sender.report(at(45ms), report_of(kA, {numbers.begin() + 1, numbers.end()}));
}

TEST(Sender, TwoCopiesGoWhereTheLossOfOneWouldBeKnownTooLate) {
  Paths p;
  make_steady(p, kA, 15ms);
  make_steady(p, kB, 20ms);
  lose_the_first(p, at(100ms));  // there at 60 ms; known to be lost at 105 ms
  EXPECT_TRUE(p.sender.poll(at(45ms), kA));
  EXPECT_TRUE(p.sender.poll(at(45ms), kB));
  EXPECT_TRUE(p.idle(at(45ms)));
}

TEST(Sender, OneCopyGoesWhereItsLossIsKnownInTime) {
  Paths p;
  make_steady(p, kA, 15ms);
  make_steady(p, kB, 20ms);
  lose_the_first(p, at(150ms));
  expect_one_copy(p);
}

TEST(Sender, OneCopyGoesOverALoadedPath) {
  Paths p;
  make_steady(p, kA, 15ms, true);
  make_steady(p, kB, 20ms);
  lose_the_first(p, at(100ms));
  expect_one_copy(p);
}

TEST(Sender, NoSecondCopyGoesOverABackup) {
  Paths p;
  make_steady(p, kA, 15ms);
  PathView backup = view(20ms);
  backup.probe_timeout = 60ms;
  backup.backup = true;
  p.sender.set_path(kB, backup);
  lose_the_first(p, at(100ms));
  expect_one_copy(p);
}

TEST(Sender, ARepairWaitsForWhatIsDueSoonerUnlessItMattersMore) {
  for (const bool matters : {false, true}) {
    for (const TimePoint due : {at(150ms), kFar}) {
      Paths p;
      make_steady(p, kA, 15ms, true);
      p.set(kB, 10ms, 100, false);
      const auto importance = static_cast<std::uint8_t>(kUsualImportance + (matters ? 72 : 0));
      const MessageId first = p.sender.send(
          at(0s), {.deadline = at(200ms), .lifetime = 200ms, .importance = importance},
          Bytes(5 * kChunk), {kA});
      TimePoint now = at(0s);
      const auto numbers = sent_on_a(p, now);
      p.send(at(40ms), due, 700, {kA});  // 77 ms of queue
      p.sender.report(at(45ms), report_of(kA, {numbers.begin() + 1, numbers.end()}));
      const auto piece = p.sender.poll(at(45ms), kA);
      ASSERT_TRUE(piece);
      EXPECT_EQ(piece->fragment.message == first, matters || due == kFar);
    }
  }
}

TEST(Sender, ARepairGoesOverASuspectPathWhereNoOtherIsInTime) {
  for (const Duration deadline : {100ms, 70ms}) {
    Paths p;
    p.set(kB, 30ms);
    const MessageId message =
        p.sender.send(at(0s), {.deadline = at(deadline), .lifetime = deadline}, Bytes(5 * kChunk),
                      {kA}, kEveryPath, wire::MessageKind::kPlain);
    TimePoint now = at(0s);
    const auto numbers = sent_on_a(p, now);
    PathView v = view(10ms);
    v.suspect = true;
    p.sender.set_path(kA, v);
    p.sender.report(at(50ms), report_of(kA, {numbers.begin() + 1, numbers.end()}));
    const auto over_a = p.sender.poll(at(50ms), kA);
    EXPECT_EQ(over_a.has_value(), deadline == 70ms) << to_ms(deadline);
    EXPECT_EQ(p.sender.poll(at(50ms), kB).has_value(), deadline == 100ms) << to_ms(deadline);
    if (over_a) {
      EXPECT_EQ(over_a->fragment.message, message);
    }
  }
}

TEST(Sender, OneCopyGoesAfterSilence) {
  Paths p;
  make_steady(p, kA, 15ms);
  make_steady(p, kB, 20ms);
  p.send(at(0s), at(100ms), 1, {kA});
  p.sender.poll(at(0s), kA);
  p.sender.handle_timeout(at(45ms));
  expect_one_copy(p);
}

TEST(Sender, ACopyThatIsSoonerIsOneOfTheTwo) {
  Paths p;
  make_steady(p, kA, 15ms);
  make_steady(p, kB, 40ms);
  p.send(at(0s), at(90ms), 5, {kA, kB});
  TimePoint now = at(0s);
  const auto numbers = sent_on_a(p, now);
  now = at(10ms);
  ASSERT_EQ(p.drain(kB, now).size(), 5U);  // there at 50 ms
  p.sender.report(at(45ms), report_of(kA, {numbers.begin() + 1, numbers.end()}));
  expect_one_copy(p);
}

TEST(Sender, WithoutRepairNothingIsSentTwice) {
  Paths p(false);
  p.send(at(0s), kFar, 1, {kA});
  p.sender.poll(at(0s), kA);
  p.sender.handle_timeout(at(50ms));
  EXPECT_EQ(p.sender.lost(kA), 1U);
  EXPECT_TRUE(p.idle(at(50ms)));
}

TEST(Sender, ADownPathRepairsNothing) {
  Paths p;
  p.set(kB, 90ms);
  p.send(at(0s), kFar, 1, {kA});
  p.sender.poll(at(0s), kA);
  p.set(kA, 10ms, 100, false);
  p.sender.handle_timeout(at(50ms));
  EXPECT_TRUE(p.sender.poll(at(50ms), kB));
}

TEST(Sender, APulledPathHandsOverWhatItOwesAtOnce) {
  Paths p;
  p.send(at(0s), kFar, 20, {kA});
  for (int i = 0; i < 5; ++i) p.sender.poll(at(i * 1ms), kA);
  p.sender.report(at(20ms), report_of(kA, {1, 2}));  // three are in flight, fifteen queued
  p.sender.pull(at(20ms), kA);
  EXPECT_FALSE(p.sender.poll(at(20ms), kA));
  TimePoint now = at(20ms);
  std::set<std::uint16_t> indices;
  std::set<std::uint64_t> numbers;
  for (const auto& piece : p.drain(kB, now)) {
    indices.insert(piece.fragment.index);
    numbers.insert(piece.number);
  }
  EXPECT_EQ(indices.size(), 18U);
  EXPECT_FALSE(indices.contains(0) || indices.contains(1));
  // It was a stall: what was in flight has arrived after all, nothing is sent a third time.
  p.set(kA, 10ms);
  EXPECT_EQ(acknowledged(p.sender.report(now, report_of(kA, {1, 2, 3, 4, 5}))), 3U);
  p.sender.report(now, report_of(kB, numbers));
  EXPECT_TRUE(p.idle(now));
  EXPECT_FALSE(p.sender.next_timeout());  // the message is complete
}

TEST(Sender, APulledPathKeepsWhatNobodyElseBringsInTime) {
  Paths p;
  p.set(kB, 100ms);
  p.send(at(0s), at(80ms), 5, {kA});
  p.sender.pull(at(0s), kA);
  EXPECT_TRUE(p.idle(at(0s)));
  p.set(kA, 10ms);
  TimePoint now = at(1ms);
  EXPECT_EQ(p.drain(kA, now).size(), 5U);
}

TEST(Sender, ABackupRepairsOnlyWhatTheOthersBringTooLate) {
  for (const Duration deadline : {200ms, 120ms}) {
    Paths p;
    PathView backup = view(5ms);
    backup.backup = true;
    p.sender.set_path(kB, backup);
    p.set(kA, 90ms);
    p.send(at(0s), at(deadline), 1, {kA});
    p.sender.poll(at(0s), kA);
    p.sender.handle_timeout(at(50ms));
    EXPECT_EQ(p.sender.poll(at(50ms), kB).has_value(), deadline == 120ms);
  }
}

TEST(Sender, OutcomesAreToldInOrderAndLossOnlyWhenItIsCertain) {
  Paths p;
  p.send(at(0s), kFar, 10, {kA});
  TimePoint now = at(0s);
  sent_on_a(p, now);
  const auto runs = [](const SentPackets::Verdicts& v) {
    std::vector<std::pair<bool, int>> out;
    for (const auto& run : v.runs) out.emplace_back(run.arrived, run.packets);
    return out;
  };
  using Runs = std::vector<std::pair<bool, int>>;
  // 3 and 6 are missing; 6 comes late.
  EXPECT_EQ(runs(p.sender.report(at(20ms), report_of(kA, {1, 2, 4, 5, 7, 8, 9, 10}))),
            (Runs{{true, 2}}));
  EXPECT_EQ(p.sender.lost(kA), 2U);
  EXPECT_EQ(runs(p.sender.report(at(30ms), report_of(kA, {1, 2, 4, 5, 6, 7, 8, 9, 10}))), Runs{});
  EXPECT_EQ(runs(p.sender.report(at(110ms), report_of(kA, {1, 2, 4, 5, 6, 7, 8, 9, 10}))),
            (Runs{{false, 1}, {true, 7}}));
}

TEST(Sender, WhatNoReportHasCoveredInTimeIsNoOutcome) {
  Paths p;
  for (int i = 0; i < 400; ++i) p.sender.take_number(at(0s), kA);
  wire::LinkReport r = report_of(kA, {400});
  r.bitmap.fill(~std::uint64_t{0});
  const auto v = p.sender.report(at(1s), r);
  ASSERT_EQ(v.runs.size(), 1U);
  EXPECT_TRUE(v.runs[0].arrived);
  EXPECT_EQ(v.runs[0].packets, wire::kAckWindow + 1);
}

TEST(Sender, ARemovedPathHandsOverWhatItOwes) {
  Paths p;
  p.send(at(0s), kFar, 20, {kA});
  for (int i = 0; i < 5; ++i) p.sender.poll(at(i * 1ms), kA);
  p.sender.report(at(20ms), report_of(kA, {1, 2}));  // three are in flight, fifteen queued
  p.sender.remove_path(at(20ms), kA);
  TimePoint now = at(20ms);
  std::set<std::uint16_t> indices;
  for (const auto& piece : p.drain(kB, now)) indices.insert(piece.fragment.index);
  EXPECT_EQ(indices.size(), 18U);
  EXPECT_FALSE(indices.contains(0) || indices.contains(1));
  EXPECT_FALSE(p.sender.next_send(kA));
}

TEST(Sender, RepairsGoOverNoPathThatIsForbidden) {
  for (const bool allowed : {false, true}) {
    Paths p;
    PathSet repairs;
    if (allowed) repairs.add(kB);
    p.sender.send(at(0s), {.deadline = at(1s), .lifetime = 1s}, Bytes(5 * kChunk), {kA}, repairs);
    TimePoint now = at(0s);
    EXPECT_EQ(p.drain(kA, now).size(), 5U);
    p.sender.pull(now, kA);
    EXPECT_EQ(p.drain(kB, now).size(), allowed ? 5U : 0U);
    if (allowed) continue;
    // The path that it was sent on may always carry it again.
    p.set(kA, 10ms);
    p.sender.handle_timeout(at(500ms));
    EXPECT_EQ(p.drain(kA, now).size(), 5U);
  }
}

}  // namespace
}  // namespace interneuron::flow::sender_repair_test
