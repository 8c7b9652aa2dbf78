#include "core/flow/sender.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "sender_support.h"
#include "tests/counted_heap.h"

namespace interneuron::flow::sender_test {
namespace {

RC_GTEST_PROP(Sender, PiecesFitThePathAndMakeUpTheMessage, ()) {
  const auto size = *rc::gen::inRange<std::size_t>(1, 40'000);
  const auto narrow = *rc::gen::inRange<std::size_t>(400, 1400);
  Paths p;
  p.sender.resize(at(0s), kB, narrow);
  Bytes message(size);
  for (std::size_t i = 0; i < size; ++i) message[i] = static_cast<std::byte>(i * 31 + i / 256);
  const auto of_header =
      *rc::gen::inRange<std::size_t>(0, std::min(size, wire::MessageBytes::kMostHeaderBytes) + 1);
  const ByteView all(message);
  const ByteView payload = all.subspan(of_header);
  p.sender.send(at(0s), {.deadline = kFar, .lifetime = 130ms},
                {all.first(of_header), Bytes(payload.begin(), payload.end())}, {kA, kB});
  Bytes joined;
  TimePoint now = at(0s);
  for (int i = 0; i < 100'000 && p.sender.next_send(kA); ++i, now += 100us) {
    while (const auto piece = p.sender.poll(now, kA)) {
      RC_ASSERT(piece->bytes.size() + kPieceOverheadBytes <= narrow);
      RC_ASSERT(piece->fragment.index * std::size_t{piece->fragment.chunk} == joined.size());
      RC_ASSERT(piece->fragment.lifetime_us == 130'000U);
      for (const ByteView bytes : {piece->bytes.header, piece->bytes.payload}) {
        joined.insert(joined.end(), bytes.begin(), bytes.end());
      }
    }
  }
  RC_ASSERT(joined == message);
}

// A small image is of no use once the large one is there: neither what waits of it nor what is
// lost.
TEST(Sender, WhatIsSupersededIsNotSent) {
  for (const bool by_report : {true, false}) {
    Paths p;
    const MessageId large = p.send(at(0s), at(300ms), 2, {kA});
    const MessageId small = p.send(at(0s), at(300ms), 4, {kB});
    const MessageId smallest = p.send(at(0s), at(300ms), 3, {kB});
    const MessageId other = p.send(at(0s), at(400ms), 1, {kB});
    p.sender.supersede(large, small);
    p.sender.supersede(small, smallest);
    TimePoint now = at(0s);
    std::set<std::uint64_t> arrived;
    for (const auto& piece : p.drain(kA, now)) arrived.insert(piece.number);
    ASSERT_EQ(arrived.size(), 2U);
    ASSERT_TRUE(p.sender.poll(now, kB));
    if (by_report) {
      p.sender.report(at(40ms), report_of(kA, arrived));
    } else {
      p.sender.complete(at(40ms), large);
    }
    now = at(40ms);
    const auto rest = p.drain(kB, now);
    ASSERT_EQ(rest.size(), 1U);
    EXPECT_EQ(rest.front().fragment.message, other);
  }
}

// A small image that is there says nothing of the large one.
TEST(Sender, WhatSupersedesIsSentToItsEnd) {
  Paths p;
  const MessageId large = p.send(at(0s), at(300ms), 3, {kA});
  const MessageId small = p.send(at(0s), at(300ms), 1, {kB});
  p.sender.supersede(large, small);
  p.sender.complete(at(1ms), small);
  TimePoint now = at(1ms);
  EXPECT_EQ(p.drain(kA, now).size(), 3U);
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
        bytes += piece->bytes.size() + kPieceOverheadBytes + 28;
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
      bytes += piece->bytes.size() + kPieceOverheadBytes + 28;
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

// What leaves a path of 100 Mbit/s, paced at 125, for a message of 150 packets; the path's own
// queue begins empty.
struct Batches {
  int count = 0;
  Duration longest_pause{};
  // How long the path had nothing to carry before the last packet came, and until when it carries.
  Duration idle{};
  TimePoint carried = at(0s);
};
Batches batches_of(Duration deadline, bool short_queue = false,
                   wire::MessageKind kind = wire::MessageKind::kPlain) {
  Paths p;
  PathView v = view(10ms, 100, true);
  v.short_queue = short_queue;
  p.sender.set_path(kA, v);
  p.sender.send(at(0s), {.deadline = at(deadline), .lifetime = deadline}, Bytes(150 * kChunk), {kA},
                {}, kind);
  Batches out;
  TimePoint now = at(0s);
  while (true) {
    ++out.count;
    while (const auto piece = p.sender.poll(now, kA)) {
      out.idle += std::max<Duration>(now - out.carried, Duration::zero());
      out.carried = std::max(out.carried, now) +
                    DataRate::mbit(100).transmit_time(ip_bytes_of_piece(piece->bytes.size()));
    }
    const auto next = p.sender.next_send(kA);
    if (!next) return out;
    out.longest_pause = std::max<Duration>(out.longest_pause, *next - now);
    now = *next;
  }
}

TEST(Sender, PacketsLeaveInBatchesWithoutAPauseOfThePath) {
  // The last packet of a batch overshoots.
  const Duration air = DataRate::mbit(125).transmit_time(ip_bytes_of_piece(kChunk));
  const Batches usual = batches_of(100ms);
  EXPECT_LE(usual.count, 11);
  EXPECT_LE(usual.longest_pause, 2ms + air);
  EXPECT_EQ(usual.idle, 0ms);
  // A twentieth of the time that the message has.
  const Batches hasty = batches_of(20ms);
  EXPECT_LE(hasty.longest_pause, 1ms + air);
  EXPECT_EQ(hasty.idle, 0ms);
  const Batches marked = batches_of(100ms, true);
  EXPECT_LE(marked.longest_pause, 500us + air);
  EXPECT_GE(marked.count, 20);
  // The stages of a round are judged by the millisecond.
  const Batches round = batches_of(100ms, false, wire::MessageKind::kRound);
  EXPECT_LE(round.longest_pause, 500us + air);
  // The message is there at the same instant.
  EXPECT_EQ(usual.carried, hasty.carried);
  EXPECT_EQ(usual.carried, marked.carried);
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
  sender.add_path(kA, kPieceOverheadBytes + 64);
  sender.send(at(0s), {.deadline = kFar, .lifetime = 1s}, Bytes(64 * 65'536), {kA});
  EXPECT_FALSE(sender.next_send(kA));
  sender.send(at(0s), {.deadline = kFar, .lifetime = 1s}, Bytes(64 * 65'535), {kA});
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
  EXPECT_EQ(sender.send(at(0s), {.deadline = kFar, .lifetime = 1s}, Bytes(1), {kA}), MessageId{7});
  EXPECT_EQ(sender.poll(at(0s), kA)->number, 1000U);
  sender.resize(at(0s), kA, 1200);  // another size: the numbers go on
  EXPECT_EQ(sender.take_number(at(0s), kA), 1001U);
}

TEST(Sender, RecordsOfPacketsAreBounded) {
  // Nothing is ever acknowledged. The process would grow by gigabytes if each record stayed; what
  // we can see is that a late acknowledgement finds only the newest 20,000 of them.
  Paths p;
  for (int i = 0; i < 100'000; ++i) p.sender.take_number(at(0s), kA);
  wire::LinkReport r{.link = kA, .largest = 100'000};
  const auto v = p.sender.report(at(1s), r);
  EXPECT_EQ(v.newest_sent, at(0s));  // of the only one acknowledged
  EXPECT_EQ(p.sender.lost(kA), 20'000U - 3);
}

TEST(Sender, ALoadedPathGivesUpWhatCannotArriveAndSaysSo) {
  for (const bool loaded : {true, false}) {
    Paths p;
    PathView v = view(10ms, 10);
    v.soon = v.rate;
    v.least_one_way = 10ms;
    v.loaded = loaded;
    p.sender.set_path(kA, v);
    // 100 pieces take 115 ms at 10 Mbit/s and 10 of them 12 ms.
    const auto send = [&p](Duration deadline, std::size_t pieces) {
      return p.sender.send(at(0s), {.deadline = at(deadline), .lifetime = deadline},
                           Bytes(pieces * kChunk), {kA}, {}, wire::MessageKind::kPlain);
    };
    const MessageId large = send(100ms, 100);
    const MessageId small = send(110ms, 10);
    const auto first = p.sender.poll(at(0s), kA);
    ASSERT_TRUE(first);
    EXPECT_EQ(first->fragment.message, loaded ? small : large);
    EXPECT_EQ(p.sender.poll_given_up(), loaded ? std::optional(large) : std::nullopt);
    EXPECT_FALSE(p.sender.poll_given_up());
  }
}

TEST(Sender, OverALoadedPathWhatMattersMoreGoesFirst) {
  for (const bool loaded : {true, false}) {
    Paths p;
    PathView v = view(10ms);
    v.loaded = loaded;
    p.sender.set_path(kA, v);
    const auto send = [&p](Duration deadline, std::uint8_t importance) {
      return p.sender.send(
          at(0s), {.deadline = at(deadline), .lifetime = deadline, .importance = importance},
          Bytes(kChunk), {kA});
    };
    const MessageId usual = send(100ms, kUsualImportance);
    const MessageId important = send(200ms, 200);
    const MessageId less = send(50ms, 0);
    EXPECT_EQ(p.sender.queued_before(kA, at(150ms), kUsualImportance), 2 * kChunk);
    EXPECT_EQ(p.sender.queued_before(kA, at(150ms), 255), loaded ? 0 : 2 * kChunk);
    const auto expected =
        loaded ? std::vector{important, usual, less} : std::vector{less, usual, important};
    TimePoint now = at(0s);
    std::vector<MessageId> order;
    for (const auto& piece : p.drain(kA, now)) order.push_back(piece.fragment.message);
    EXPECT_EQ(order, expected);
  }
}

TEST(Sender, ANewLifeOfThePeerVoidsEverything) {
  Paths p;
  p.send(at(0s), kFar, 10, {kA, kB});
  p.sender.poll(at(0s), kA);
  p.sender.reset(at(1ms));
  EXPECT_FALSE(p.sender.next_send(kA) || p.sender.next_send(kB));
  EXPECT_FALSE(p.sender.next_timeout());
}

// Its packet may arrive as late as the deadline, long after its record is gone.
TEST(Sender, OfAPacketThatNobodyRemembersNothingIsCertain) {
  for (const bool is_remembered : {true, false}) {
    Paths p(false);
    const TimePoint deadline = at(10s);
    p.sender.send(at(0s), {.deadline = deadline, .lifetime = 10s}, Bytes(kChunk), {kA}, {},
                  wire::MessageKind::kPlain);
    ASSERT_TRUE(p.sender.poll(at(0s), kA));
    // Any later packet makes room for itself.
    if (!is_remembered) p.sender.take_number(at(9s), kA);
    p.sender.handle_timeout(deadline);
    EXPECT_FALSE(p.sender.poll_incomplete());
    const wire::LinkReport report = report_of(kA, {5});
    p.sender.settle_overdue(std::vector{report}, deadline + 1ms);
    EXPECT_EQ(p.sender.poll_incomplete().has_value(), is_remembered);
  }
}

// A report may name any of 65,536 links.
TEST(Sender, WhatIsToldOfLinksThatThereAreNotIsNotKept) {
  Paths p;
  std::vector<wire::LinkReport> reports(1);
  p.sender.settle_overdue(reports, at(1s));
  const std::int64_t before = held_bytes;
  for (std::uint32_t link = 0; link <= UINT16_MAX; ++link) {
    if (LinkId{static_cast<std::uint16_t>(link)} == kB) continue;
    reports[0].link = LinkId{static_cast<std::uint16_t>(link)};
    p.sender.settle_overdue(reports, at(1s));
  }
  EXPECT_EQ(held_bytes, before);
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

}  // namespace
}  // namespace interneuron::flow::sender_test
