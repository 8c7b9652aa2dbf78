#include "core/flow/sender.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

namespace interneuron::flow {
namespace {

using namespace std::chrono_literals;

constexpr LinkId kA{0};
constexpr LinkId kB{1};
constexpr std::size_t kDatagram = 1400;
constexpr std::size_t kChunk = kDatagram - wire::kFragmentOverhead;
constexpr TimePoint kFar{1h};

TimePoint at(Duration d) { return TimePoint{d}; }

PathView view(Duration one_way, double mbit = 100, bool up = true) {
  PathView v;
  v.up = up;
  v.rate = DataRate::mbit(mbit);
  v.pace = DataRate::mbit(mbit * 1.25);
  v.one_way = one_way;
  v.probe_timeout = 50ms;
  return v;
}

// Paths at 100 Mbit/s, 10 ms one way.
struct Paths {
  Sender sender;
  explicit Paths(bool repair = true) : sender({.repair = repair}) {
    for (const LinkId link : {kA, kB}) {
      sender.add_path(link, kDatagram);
      set(link, 10ms);
    }
  }
  void set(LinkId link, Duration one_way, double mbit = 100, bool up = true) {
    sender.set_path(link, view(one_way, mbit, up));
  }
  MessageId send(TimePoint now, TimePoint deadline, std::size_t pieces, std::vector<LinkId> on) {
    return sender.send(now, deadline, deadline - now, Bytes(pieces * kChunk), on);
  }
  // Nothing more may leave, now or later.
  bool idle(TimePoint now) {
    const bool sent = sender.poll(now, kA) || sender.poll(now, kB);
    return !sent && !sender.next_send(kA) && !sender.next_send(kB);
  }
  // Everything that leaves a path, in time.
  std::vector<Sender::Piece> drain(LinkId link, TimePoint& now, Duration step = 100us,
                                   int turns = 100'000) {
    std::vector<Sender::Piece> out;
    for (int i = 0; i < turns && sender.next_send(link); ++i, now += step) {
      while (const auto piece = sender.poll(now, link)) out.push_back(*piece);
    }
    return out;
  }
};

wire::LinkReport report_of(LinkId link, const std::set<std::uint64_t>& arrived) {
  wire::LinkReport r;
  r.link = link;
  if (arrived.empty()) return r;
  r.largest = *arrived.rbegin();
  for (const std::uint64_t n : arrived) {
    const std::uint64_t back = r.largest - n;
    if (back > 0 && back <= wire::kAckWindow)
      r.bitmap[(back - 1) / 64] |= 1ULL << ((back - 1) % 64);
  }
  return r;
}

RC_GTEST_PROP(Sender, PiecesFitThePathAndMakeUpTheMessage, ()) {
  const auto size = *rc::gen::inRange<std::size_t>(1, 40'000);
  const auto narrow = *rc::gen::inRange<std::size_t>(400, 1400);
  Paths p;
  p.sender.add_path(kB, narrow);
  Bytes message(size);
  for (std::size_t i = 0; i < size; ++i) message[i] = static_cast<std::byte>(i * 31 + i / 256);
  p.sender.send(at(0s), kFar, 130ms, message, {kA, kB});
  Bytes joined;
  TimePoint now = at(0s);
  for (int i = 0; i < 100'000 && p.sender.next_send(kA); ++i, now += 100us) {
    while (const auto piece = p.sender.poll(now, kA)) {
      RC_ASSERT(piece->bytes.size() + wire::kFragmentOverhead <= narrow);
      RC_ASSERT(piece->fragment.index * std::size_t{piece->fragment.chunk} == joined.size());
      RC_ASSERT(piece->fragment.lifetime_us == 130'000U);
      joined.insert(joined.end(), piece->bytes.begin(), piece->bytes.end());
    }
  }
  RC_ASSERT(joined == message);
}

TEST(Sender, TheEarliestDeadlineGoesFirst) {
  Paths p;
  const MessageId late = p.send(at(0s), at(300ms), 3, {kA});
  const MessageId soon = p.send(at(0s), at(100ms), 3, {kA});
  TimePoint now = at(0s);
  std::vector<MessageId> order;
  for (const auto& piece : p.drain(kA, now)) order.push_back(piece.fragment.message);
  EXPECT_EQ(order, (std::vector{soon, soon, soon, late, late, late}));
}

TEST(Sender, PacesAQuarterAboveTheRateWhateverTheTimer) {
  for (const Duration step : {50us, 500us, 900us}) {
    Paths p;
    p.set(kA, 10ms, 80);
    p.send(at(0s), kFar, 2000, {kA});
    TimePoint now = at(0s);
    std::size_t bytes = 0;
    while (now < at(200ms)) {
      while (const auto piece = p.sender.poll(now, kA))
        bytes += piece->bytes.size() + wire::kFragmentOverhead + 28;
      now += step;
    }
    EXPECT_NEAR(rate_of(bytes, 200ms).mbit(), 100, 5) << step.count();
  }
}

TEST(Sender, AnUnknownRateIsPacedBlindly) {
  Paths p;
  PathView unknown;
  unknown.probe_timeout = 200ms;
  p.sender.set_path(kA, unknown);
  p.send(at(0s), kFar, 2000, {kA});
  std::size_t bytes = 0;
  for (TimePoint now = at(0s); now < at(400ms); now += 300us) {
    while (const auto piece = p.sender.poll(now, kA))
      bytes += piece->bytes.size() + wire::kFragmentOverhead + 28;
  }
  EXPECT_NEAR(rate_of(bytes, 400ms).mbit(), 25, 1.25);
}

TEST(Sender, IdlingSavesUpAMillisecondOnly) {
  Paths p;
  p.send(at(0s), kFar, 100, {kA});
  p.sender.poll(at(0s), kA);
  int burst = 0;
  while (p.sender.poll(at(10s), kA)) ++burst;
  EXPECT_LE(burst, 11);  // 1 ms at 125 Mbit/s and the one that overshoots
  EXPECT_GE(burst, 9);
}

TEST(Sender, TheTimerNeverSpins) {
  // What next_send() says is an instant at which poll() yields something, or the job is over.
  Paths p;
  p.send(at(0s), at(1s), 50, {kA});
  TimePoint now = at(0s);
  int idle = 0;
  while (const auto next = p.sender.next_send(kA)) {
    now = std::max(now, *next);
    int sent = 0;
    while (p.sender.poll(now, kA)) ++sent;
    if (sent == 0) ++idle;
    ASSERT_LE(idle, 1);
  }
}

// --- loss

// Sends `pieces` on A; returns their numbers.
std::vector<std::uint64_t> sent_on_a(Paths& p, TimePoint& now) {
  std::vector<std::uint64_t> numbers;
  for (const auto& piece : p.drain(kA, now)) numbers.push_back(piece.number);
  return numbers;
}

TEST(Sender, ThreeLaterPacketsMakeALoss) {
  Paths p;
  p.send(at(0s), kFar, 5, {kA});
  TimePoint now = at(0s);
  ASSERT_EQ(sent_on_a(p, now), (std::vector<std::uint64_t>{1, 2, 3, 4, 5}));
  auto v = p.sender.report(now, report_of(kA, {2, 3}));
  EXPECT_EQ(v.acknowledged, 2U);
  EXPECT_EQ(v.lost, 0U);
  v = p.sender.report(now, report_of(kA, {2, 3, 4}));
  EXPECT_EQ(v.acknowledged, 1U);
  EXPECT_EQ(v.lost, 1U);
  EXPECT_TRUE(p.sender.next_send(kA) || p.sender.next_send(kB));
  v = p.sender.report(now, report_of(kA, {2, 3, 4}));  // nothing new
  EXPECT_EQ(v.acknowledged + v.lost, 0U);
}

TEST(Sender, ReportsOfPacketsNeverSentAreVoid) {
  Paths p;
  p.send(at(0s), kFar, 2, {kA});
  TimePoint now = at(0s);
  sent_on_a(p, now);
  for (const auto& r :
       {report_of(kA, {1, 2, 3}), report_of(kA, {UINT64_MAX}), report_of(LinkId{9}, {1})}) {
    const auto v = p.sender.report(now, r);
    EXPECT_EQ(v.acknowledged + v.lost, 0U);
    EXPECT_TRUE(v.runs.empty());
    EXPECT_FALSE(v.newest_sent);
  }
  EXPECT_EQ(p.sender.report(now, report_of(kA, {1, 2})).acknowledged, 2U);
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
  EXPECT_EQ(p.sender.report(now, report_of(kA, {1, 2, 3, 4, 5})).acknowledged, 3U);
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

TEST(Sender, ATrainIsToldWithTheRateThatItWasSentAt) {
  Paths p;
  p.send(at(0s), kFar, 40, {kA});
  TimePoint now = at(0s);
  const auto pieces = p.drain(kA, now, 10us);
  ASSERT_EQ(pieces.size(), 40U);
  std::set<std::uint64_t> all;
  for (const auto& piece : pieces) all.insert(piece.number);
  wire::LinkReport r = report_of(kA, all);
  EXPECT_FALSE(p.sender.report(now, r).train_known);
  r.train_start = 11;  // the ten before left in one burst
  r.train_packets = 30;
  const auto v = p.sender.report(now, r);
  ASSERT_TRUE(v.train_known && v.train_sent_at);
  EXPECT_NEAR(v.train_sent_at->mbit(), 125, 6);
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

TEST(Sender, NothingLeavesAtOrAfterTheDeadline) {
  Paths p;
  p.send(at(0s), at(10ms), 100, {kA});
  EXPECT_TRUE(p.sender.poll(at(10ms - 1ns), kA));
  EXPECT_FALSE(p.sender.poll(at(10ms), kA));
  p.send(at(10ms), at(10ms), 1, {kA});
  EXPECT_FALSE(p.sender.next_send(kA));
  EXPECT_EQ(p.sender.next_timeout(), at(10ms));
  p.sender.handle_timeout(at(10ms));
}

TEST(Sender, AMessageOfMorePiecesThanCanBeCountedIsNotSent) {
  Sender sender({});
  sender.add_path(kA, wire::kFragmentOverhead + 64);
  sender.send(at(0s), kFar, 1s, Bytes(64 * 65'536), {kA});
  EXPECT_FALSE(sender.next_send(kA));
  sender.send(at(0s), kFar, 1s, Bytes(64 * 65'535), {kA});
  EXPECT_TRUE(sender.next_send(kA));
}

TEST(Sender, APathThatIsNeverPolledKeepsNothingPastItsDeadline) {
  Paths p;
  for (int i = 0; i < 100; ++i) p.send(at(i * 1ms), at(i * 1ms + 130ms), 1, {kA});
  p.sender.handle_timeout(at(1s));
  EXPECT_FALSE(p.sender.next_send(kA));
  EXPECT_FALSE(p.sender.next_timeout());
}

TEST(Sender, NumbersAndMessagesBeginWhereTheyAreTold) {
  Sender sender({.repair = true, .first_message = MessageId{7}});
  sender.add_path(kA, kDatagram, 1000);
  EXPECT_EQ(sender.send(at(0s), kFar, 1s, Bytes(1), {kA}), MessageId{7});
  EXPECT_EQ(sender.poll(at(0s), kA)->number, 1000U);
  sender.add_path(kA, 1200, 1);  // another size: the numbers go on
  EXPECT_EQ(sender.take_number(at(0s), kA), 1001U);
}

TEST(Sender, RecordsOfPacketsAreBounded) {
  // Nothing is ever acknowledged. The process would grow by gigabytes if each record stayed; what
  // we can see is that a late acknowledgement finds only the newest 20,000 of them.
  Paths p;
  for (int i = 0; i < 100'000; ++i) p.sender.take_number(at(0s), kA);
  wire::LinkReport r;
  r.link = kA;
  r.largest = 100'000;
  const auto v = p.sender.report(at(1s), r);
  EXPECT_EQ(v.acknowledged, 1U);
  EXPECT_LE(v.acknowledged + v.lost, 20'000U);
}

TEST(Sender, ANewLifeOfThePeerVoidsEverything) {
  Paths p;
  p.send(at(0s), kFar, 10, {kA, kB});
  p.sender.poll(at(0s), kA);
  p.sender.reset(at(1ms));
  EXPECT_FALSE(p.sender.next_send(kA) || p.sender.next_send(kB));
  EXPECT_FALSE(p.sender.next_timeout());
}

// Whatever is lost and however reports come: nothing leaves at or after its deadline, and with time
// enough every piece arrives.
RC_GTEST_PROP(Sender, WithTimeEnoughEveryPieceArrives, ()) {
  Paths p;
  const auto pieces = *rc::gen::inRange<std::size_t>(1, 60);
  const auto loss = *rc::gen::inRange(0, 60);
  std::mt19937 rng(*rc::gen::arbitrary<std::uint32_t>());
  p.send(at(0s), at(60s), pieces, {kA});
  std::map<LinkId, std::set<std::uint64_t>> arrived;
  std::set<std::uint16_t> have;
  for (TimePoint now = at(0s); now < at(20s) && have.size() < pieces; now += 1ms) {
    for (const LinkId link : {kA, kB}) {
      while (const auto piece = p.sender.poll(now, link)) {
        if (static_cast<int>(rng() % 100) < loss) continue;
        arrived[link].insert(piece->number);
        have.insert(piece->fragment.index);
      }
      if (rng() % 16 == 0) p.sender.report(now, report_of(link, arrived[link]));
    }
    p.sender.handle_timeout(now);
    if (const auto next = p.sender.next_timeout()) RC_ASSERT(*next > now);
  }
  RC_ASSERT(have.size() == pieces);
}

TEST(Sender, RepairsGoOverNoPathThatIsForbidden) {
  for (const bool allowed : {false, true}) {
    Paths p;
    PathSet repairs;
    repairs.set(kB.value, allowed);
    p.sender.send(at(0s), at(1s), 1s, Bytes(5 * kChunk), {kA}, repairs);
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
}  // namespace interneuron::flow
