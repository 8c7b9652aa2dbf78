// What a Reassembler holds and takes, whatever a peer sends.
#include <gtest/gtest.h>

#include "core/code/blocks.h"
#include "core/flow/receiver.h"
#include "tests/counted_heap.h"

namespace interneuron::flow {
namespace {

using namespace std::chrono_literals;
using Result = Reassembler::Result;

constexpr ClockBounds kNoClocks{};

// A packet of a message, which brings as many bytes as it has to.
wire::Data packet(const wire::FragmentHeader& message, std::size_t index, const Bytes& bytes) {
  wire::Data d{message, {}};
  d.fragment.index = static_cast<std::uint16_t>(index);
  d.bytes = ByteView(bytes).first(d.fragment.bytes());
  return d;
}

// Beside what is counted, for each place of a message: the place itself, where it is found by its
// number and by when it expires, and what a message leaves there.
constexpr std::int64_t kBesideBytes = Reassembler::kMaxPartials * 1024;

// Large messages that nobody completes, one after the other, of each a second's symbols; a small
// one after each, which lives for an hour, takes the place that it leaves.
TEST(ReassemblerBounds, WhatHasExpiredLeavesNoMemoryBehind) {
  Reassembler r;
  const Bytes bytes(kMaxPieceBytes);
  const std::int64_t before = held_bytes;
  TimePoint now{1s};
  for (std::uint32_t round = 0; round < 50; ++round) {
    const wire::FragmentHeader large{MessageId{2 * round}, 0,
                                     kMaxPieceBytes,       3'000'000,
                                     std::uint32_t{1'000}, wire::MessageKind::kPlain};
    const code::Blocks blocks(large.count());
    for (std::size_t i = blocks.count(); i < blocks.end(); ++i) {
      r.add(now, packet(large, i, bytes), kNoClocks);
    }
    now += 10ms;
    EXPECT_EQ(r.expire(now), 1U);
    while (r.poll_forgotten()) continue;
    const wire::FragmentHeader small{MessageId{2 * round + 1}, 0, 1, 2, UINT32_MAX,
                                     wire::MessageKind::kPlain};
    EXPECT_EQ(r.add(now, packet(small, 0, bytes), kNoClocks).result, Result::kStored);
  }
  EXPECT_LE(held_bytes - before, static_cast<std::int64_t>(r.bytes()) + kBesideBytes);
}

// What a message needs is taken at once, and not again when there are more of them.
TEST(ReassemblerBounds, MoreMessagesAtOnceCopyNone) {
  Reassembler r;
  constexpr std::uint16_t kMost = kMaxPieceBytes;
  const Bytes bytes(kMost);
  const auto first = [&](std::uint32_t id) {
    const wire::FragmentHeader message{MessageId{id}, 0,          kMost,
                                       20'000,        UINT32_MAX, wire::MessageKind::kPlain};
    r.add(TimePoint{1s}, packet(message, 0, bytes), kNoClocks);
    return message;
  };
  const wire::FragmentHeader oldest = first(0);
  for (std::uint32_t id = 1; id < 100; ++id) first(id);
  const std::uint64_t before = allocations;
  for (std::size_t i = 1; i + 1 < oldest.count(); ++i) {
    r.add(TimePoint{1s}, packet(oldest, i, bytes), kNoClocks);
  }
  EXPECT_EQ(allocations, before);
}

// No packet brings such a symbol; where one came by another way, it would be longer than the room
// that decoding has for it.
TEST(ReassemblerBounds, ASymbolThatIsLongerThanAnyPieceIsBad) {
  Reassembler r;
  const Bytes bytes(20'000);
  const wire::FragmentHeader message{MessageId{1}, 0,         20'000,
                                     40'000,       1'000'000, wire::MessageKind::kPlain};
  EXPECT_EQ(r.add(TimePoint{1s}, packet(message, 0, bytes), kNoClocks).result, Result::kStored);
  EXPECT_EQ(r.add(TimePoint{1s}, packet(message, 2, bytes), kNoClocks).result, Result::kBad);
  EXPECT_EQ(r.add(TimePoint{1s}, packet(message, 1, bytes), kNoClocks).result, Result::kComplete);
}

}  // namespace
}  // namespace interneuron::flow
