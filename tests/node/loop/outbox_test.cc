#include "node/loop/outbox.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <cstring>

namespace interneuron::outbox_test {
namespace {

using std::chrono::milliseconds;

constexpr TimePoint kStart{Duration{1'000'000'000}};

std::uint32_t number_of(ByteView bytes) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data(), sizeof number);
  return number;
}

// Gives numbered datagrams, as many as it was told to, each to a link that a rule chooses.
class Numbers final : public Outbox::Source {
 public:
  std::optional<TransmitParts> poll(TimePoint, std::span<std::byte> buffer) override {
    if (next == end) return std::nullopt;
    std::memcpy(buffer.data(), &next, sizeof next);
    const LinkId link{static_cast<std::uint8_t>(links == 1 ? 0 : next % links)};
    ++next;
    return TransmitParts{link, {}, sizeof next};
  }
  std::uint32_t next = 0;
  std::uint32_t end = 0;
  std::uint32_t links = 1;
};

// Takes as many datagrams as it has room for.
class Bottle final : public Transport {
 public:
  BatchResult send(std::span<const Outgoing> batch) override {
    ++calls;
    BatchResult result;
    if (gone != 0) return {batch.size(), false, gone};
    for (const Outgoing& datagram : batch) {
      if (number_of(datagram.head) == forbidden || refusing) {
        result.refused = true;
        break;
      }
      if (room == 0) {
        result.would_block = true;
        break;
      }
      --room;
      ++result.taken;
      sent.push_back(number_of(datagram.head));
    }
    result.refused = result.refused || holding;
    return result;
  }
  std::span<const Incoming> receive() override { return {}; }
  TransportCaps capabilities() const override { return {}; }
  TransportCounters counters() const override { return {}; }
  Address local_address() const override { return {}; }
  int native_handle() const override { return -1; }

  std::size_t room = static_cast<std::size_t>(-1);
  int gone = 0;
  bool refusing = false;
  // Keeps some of what it took to itself.
  bool holding = false;
  std::uint32_t forbidden = UINT32_MAX;
  int calls = 0;
  std::vector<std::uint32_t> sent;
};

std::vector<std::uint32_t> count_to(std::uint32_t end, std::uint32_t first = 0,
                                    std::uint32_t step = 1) {
  std::vector<std::uint32_t> out;
  for (std::uint32_t i = first; i < end; i += step) out.push_back(i);
  return out;
}

TEST(Outbox, ATurnIsBoundedAndLeavesAsOneBatch) {
  Bottle transport;
  Outbox outbox;
  outbox.add(LinkId{0}, transport);
  Numbers source;
  source.end = kDatagramsPerTurn + 10;
  EXPECT_EQ(outbox.pump(kStart, source), Outbox::More::kNow);
  EXPECT_EQ(transport.sent, count_to(kDatagramsPerTurn));
  EXPECT_EQ(transport.calls, 1);
  EXPECT_EQ(outbox.pump(kStart, source), Outbox::More::kNo);
  EXPECT_EQ(transport.sent, count_to(kDatagramsPerTurn + 10));
}

TEST(Outbox, AFullSocketBufferLosesNothing) {
  Bottle transport;
  transport.room = 7;
  Outbox outbox;
  outbox.add(LinkId{0}, transport);
  Numbers source;
  source.end = 5000;
  TimePoint now = kStart;
  bool paused = false;
  for (int turns = 0; transport.sent.size() < source.end; ++turns) {
    ASSERT_LT(turns, 100000);
    paused |= outbox.pump(now, source) == Outbox::More::kBlocked;
    ASSERT_LE(outbox.queued(LinkId{0}), kQueueDatagrams);
    if (!outbox.blocked(LinkId{0})) continue;
    const int calls = transport.calls;
    outbox.pump(now, source);
    EXPECT_EQ(transport.calls, calls) << "tried again although nothing became writable";
    now += milliseconds(4);  // within the patience
    transport.room = 1 + static_cast<std::size_t>(turns) % 90;
    outbox.writable(now, LinkId{0});
  }
  EXPECT_TRUE(paused);
  EXPECT_EQ(transport.sent, count_to(5000));
  EXPECT_EQ(outbox.stalled(LinkId{0}), 0u);
}

TEST(Outbox, AStalledLinkHoldsUpTheOtherOnlyForThePatience) {
  Bottle good;
  Bottle stuck;
  stuck.room = 0;
  Outbox outbox;
  outbox.add(LinkId{0}, good);
  outbox.add(LinkId{1}, stuck);
  Numbers source;
  source.links = 2;
  source.end = 4000;
  TimePoint now = kStart;
  Outbox::More more = Outbox::More::kNow;
  while (more == Outbox::More::kNow) more = outbox.pump(now, source);
  EXPECT_EQ(more, Outbox::More::kBlocked);
  EXPECT_EQ(outbox.queued(LinkId{1}), kQueueDatagrams);
  EXPECT_EQ(outbox.next_timeout(now), kStart + kStallPatience);
  EXPECT_EQ(outbox.pump(now + kStallPatience - Duration{1}, source), Outbox::More::kBlocked);

  now += kStallPatience;
  do more = outbox.pump(now, source);
  while (more == Outbox::More::kNow);
  EXPECT_EQ(more, Outbox::More::kNo);
  EXPECT_EQ(good.sent, count_to(4000, 0, 2));
  EXPECT_EQ(outbox.stalled(LinkId{1}), 2000 - kQueueDatagrams);
  EXPECT_FALSE(outbox.next_timeout(now)) << "nothing to wait for but writability";

  // The newest are kept, in order.
  stuck.room = static_cast<std::size_t>(-1);
  outbox.writable(now + milliseconds(50), LinkId{1});
  const auto odd = count_to(4000, 1, 2);
  EXPECT_EQ(stuck.sent, std::vector(odd.end() - std::ptrdiff_t{kQueueDatagrams}, odd.end()));
  EXPECT_FALSE(outbox.blocked(LinkId{1}));
}

TEST(Outbox, WhatTheKernelRefusesForNowIsKeptAndOfferedAgain) {
  Bottle transport;
  Numbers source;
  Outbox outbox;
  outbox.add(LinkId{0}, transport);
  source.end = 10;
  transport.refusing = true;
  EXPECT_EQ(outbox.pump(kStart, source), Outbox::More::kNo);
  EXPECT_EQ(outbox.queued(LinkId{0}), 10U);
  EXPECT_FALSE(outbox.blocked(LinkId{0}));
  EXPECT_EQ(outbox.next_timeout(kStart), kStart + kRefusedRetry);
  const int calls = transport.calls;
  outbox.pump(kStart + kRefusedRetry - Duration{1}, source);
  EXPECT_EQ(transport.calls, calls) << "not before its time";
  transport.refusing = false;
  outbox.pump(kStart + kRefusedRetry, source);
  EXPECT_EQ(transport.sent, count_to(10));
  EXPECT_FALSE(outbox.next_timeout(kStart + kRefusedRetry));
  EXPECT_EQ(outbox.stalled(LinkId{0}), 0U);
}

TEST(Outbox, WhatIsRefusedForTooLongMakesWayForTheOthers) {
  Bottle transport;
  Numbers source;
  Outbox outbox;
  outbox.add(LinkId{0}, transport);
  source.end = 10;
  transport.forbidden = 3;
  TimePoint now = kStart;
  outbox.pump(now, source);
  EXPECT_EQ(outbox.queued(LinkId{0}), 7U);
  while (const auto next = outbox.next_timeout(now)) {
    now = *next;
    outbox.pump(now, source);
    ASSERT_LE(now, kStart + kStallPatience);
  }
  EXPECT_EQ(now, kStart + kStallPatience);
  EXPECT_EQ(transport.sent, (std::vector<std::uint32_t>{0, 1, 2, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(outbox.stalled(LinkId{0}), 1U);
}

TEST(Outbox, ALinkThatTakesNothingAnyMoreKeepsNothing) {
  Bottle transport;
  Numbers source;
  Outbox outbox;
  outbox.add(LinkId{0}, transport);
  source.end = 5;
  transport.refusing = true;
  outbox.pump(kStart, source);
  outbox.pump(kStart + kStallPatience, source);
  EXPECT_EQ(outbox.queued(LinkId{0}), 0U);
  EXPECT_EQ(outbox.stalled(LinkId{0}), 5U);
  EXPECT_FALSE(outbox.next_timeout(kStart + kStallPatience));
}

TEST(Outbox, ATransportThatHoldsWhatItTookIsCalledUntilItDoesNot) {
  Bottle transport;
  Numbers source;
  Outbox outbox;
  outbox.add(LinkId{0}, transport);
  source.end = 10;
  transport.holding = true;
  TimePoint now = kStart;
  // For much longer than what is refused is kept: what is held cannot be dropped.
  for (int calls = 1; now < kStart + 4 * kStallPatience; ++calls) {
    outbox.pump(now, source);
    EXPECT_EQ(transport.calls, calls);
    EXPECT_EQ(outbox.queued(LinkId{0}), 0U);
    ASSERT_EQ(outbox.next_timeout(now), now + kRefusedRetry);
    now += kRefusedRetry;
  }
  // Also when whoever asks is late.
  EXPECT_GT(outbox.next_timeout(now).value_or(TimePoint::min()), now);
  transport.holding = false;
  outbox.pump(now, source);
  EXPECT_FALSE(outbox.next_timeout(now));
  EXPECT_EQ(transport.sent, count_to(10));
  EXPECT_EQ(outbox.stalled(LinkId{0}), 0U);
}

// Gives datagrams whose payload is its own, and may be overwritten once pump() is over.
class Borrowed final : public Outbox::Source {
 public:
  std::optional<TransmitParts> poll(TimePoint, std::span<std::byte> buffer) override {
    if (left == 0) return std::nullopt;
    --left;
    buffer[0] = std::byte{1};
    buffer[1] = std::byte{3};
    return TransmitParts{LinkId{0}, {}, 1, payload, 1};
  }
  Bytes payload = Bytes(100, std::byte{2});
  std::size_t left = 0;
};

class Recorder final : public Transport {
 public:
  BatchResult send(std::span<const Outgoing> batch) override {
    BatchResult result;
    result.would_block = blocked;
    if (blocked) return result;
    for (const Outgoing& datagram : batch) {
      parts += datagram.payload.empty() ? 0U : 1U;
      sent.push_back(datagram.joined());
    }
    result.taken = batch.size();
    return result;
  }
  std::span<const Incoming> receive() override { return {}; }
  TransportCaps capabilities() const override { return {}; }
  TransportCounters counters() const override { return {}; }
  Address local_address() const override { return {}; }
  int native_handle() const override { return -1; }

  bool blocked = false;
  std::size_t parts = 0;
  std::vector<Bytes> sent;
};

TEST(Outbox, PayloadsLeaveWhereTheyAreAndWhatWaitsIsKept) {
  Recorder transport;
  Borrowed source;
  Outbox outbox;
  outbox.add(LinkId{0}, transport);
  Bytes expected(1, std::byte{1});
  expected.insert(expected.end(), source.payload.begin(), source.payload.end());
  expected.push_back(std::byte{3});

  source.left = 3;
  outbox.pump(kStart, source);
  EXPECT_EQ(transport.sent, std::vector(3, expected));
  EXPECT_EQ(transport.parts, 3U) << "nobody has copied them";

  transport.sent.clear();
  transport.blocked = true;
  source.left = 2;
  outbox.pump(kStart, source);
  source.left = 1;
  outbox.collect(kStart, source);
  source.payload.assign(100, std::byte{9});
  transport.blocked = false;
  outbox.writable(kStart, LinkId{0});
  EXPECT_EQ(transport.sent, std::vector(3, expected)) << "the message may be gone by then";
}

TEST(Outbox, AVanishedLinkIsReportedOnceAndItsDatagramsAreDropped) {
  Bottle transport;
  transport.gone = ENODEV;
  Outbox outbox;
  outbox.add(LinkId{0}, transport);
  Numbers source;
  source.end = 3;
  EXPECT_EQ(outbox.pump(kStart, source), Outbox::More::kNo);
  EXPECT_EQ(outbox.take_gone(), (std::vector<std::pair<LinkId, int>>{{LinkId{0}, ENODEV}}));
  EXPECT_TRUE(outbox.take_gone().empty());
  outbox.remove(LinkId{0});
  source.end = 6;
  EXPECT_EQ(outbox.pump(kStart, source), Outbox::More::kNo);
  EXPECT_EQ(source.next, 6u) << "what is meant for no link is dropped, not kept";
}

}  // namespace
}  // namespace interneuron::outbox_test
