// What a Reassembler holds and takes, whatever a peer sends.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>
#include <vector>

#include "core/code/blocks.h"
#include "core/code/erasure_code.h"
#include "core/flow/reassembler.h"
#include "tests/counted_heap.h"

namespace interneuron::flow::reassembler_bounds_test {
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

// A symbol of one byte needs no less to be kept in mind than one of a packet.
TEST(ReassemblerBounds, ManySmallSymbolsHoldNoMoreThanIsCounted) {
  const Bytes bytes(1);
  for (const std::uint32_t size : {2'000U, 8'192U, 47'500U}) {
    Reassembler r;
    const std::int64_t before = held_bytes;
    for (std::uint32_t m = 0; m < Reassembler::kMaxPartials; ++m) {
      const wire::FragmentHeader message{MessageId{m}, 0,          1,
                                         size,         UINT32_MAX, wire::MessageKind::kPlain};
      const code::Blocks blocks(size);
      const std::size_t end = std::min<std::size_t>(blocks.end(), UINT16_MAX + std::size_t{1});
      for (std::size_t i = blocks.count(); i < end; ++i) {
        r.add(TimePoint{1s}, packet(message, i, bytes), kNoClocks);
      }
    }
    EXPECT_LE(held_bytes - before, static_cast<std::int64_t>(r.bytes()) + kBesideBytes) << size;
    EXPECT_LE(r.bytes(), Reassembler::kMaxBytes);
  }
}

// The largest message that there is, of which one packet in a hundred is lost and as many symbols
// have come: all of them are kept, whenever they come, and nothing is missing in the end.
TEST(ReassemblerBounds, SymbolsOfTheLargestMessageFindRoom) {
  constexpr std::size_t kLost = 62;
  constexpr std::uint16_t kChunk = kMaxPieceBytes;
  Bytes whole(kMaxMessageBytes + wire::kPlainHeaderBytes);
  std::mt19937_64 random(1);
  for (std::byte& b : whole) b = static_cast<std::byte>(random());
  // The flags of a plain header, which say how long it is.
  whole[wire::kPlainHeaderBytes - 1] = std::byte{};
  const wire::FragmentHeader message{MessageId{1}, 0,
                                     kChunk,       static_cast<std::uint32_t>(whole.size()),
                                     1'000'000,    wire::MessageKind::kPlain};
  const code::Blocks blocks(message.count());
  ASSERT_EQ(blocks.count(), 6228U);
  Bytes padded = whole;
  padded.resize(blocks.count() * kChunk);
  // The first pieces, so that two of most blocks are lost, and the last one, which is shorter.
  std::vector<std::size_t> lost(kLost - 1);
  std::iota(lost.begin(), lost.end(), 0U);
  lost.push_back(blocks.count() - 1);
  std::vector<std::pair<std::size_t, Bytes>> symbols;
  std::map<std::size_t, std::size_t> rows;
  for (const std::size_t piece : lost) {
    const std::size_t b = blocks.block_of(piece);
    std::vector<const std::byte*> in;
    for (std::size_t c = 0; c < blocks.pieces(b); ++c) {
      in.push_back(padded.data() + blocks.piece_at(b, c) * kChunk);
    }
    Bytes symbol(kChunk);
    std::byte* const out = symbol.data();
    code::encode(in, kChunk, rows[b], {&out, 1});
    symbols.emplace_back(blocks.symbol_at(b, rows[b]++), std::move(symbol));
  }
  for (const bool symbols_first : {false, true}) {
    Reassembler r;
    std::size_t complete = 0;
    const auto take = [&](std::size_t index, ByteView bytes) {
      wire::Data d{message, bytes};
      d.fragment.index = static_cast<std::uint16_t>(index);
      auto outcome = r.add(TimePoint{1s}, d, kNoClocks);
      ASSERT_TRUE(outcome.result == Result::kStored || outcome.result == Result::kComplete);
      if (outcome.result == Result::kStored) return;
      ++complete;
      const ByteView header = ByteView(whole).first(wire::kPlainHeaderBytes);
      const ByteView payload = ByteView(whole).subspan(wire::kPlainHeaderBytes);
      EXPECT_TRUE(std::ranges::equal(outcome.message.header, header));
      EXPECT_TRUE(std::ranges::equal(outcome.message.payload, payload));
    };
    const auto take_symbols = [&] {
      for (const auto& [index, bytes] : symbols) take(index, bytes);
    };
    if (symbols_first) take_symbols();
    for (std::size_t i = kLost - 1; i < blocks.count() - 1; ++i) {
      take(i, ByteView(whole).subspan(i * kChunk, kChunk));
    }
    if (!symbols_first) take_symbols();
    EXPECT_EQ(complete, 1U) << symbols_first;
  }
}

// What a message needs is taken in runs that double, and nothing is copied when there are more of
// them.
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
  EXPECT_LE(allocations, before + 2);
}

// No packet brings such a symbol; where one came by another way, it would be longer than the room
// that decoding has for it.
TEST(ReassemblerBounds, ASymbolThatIsLongerThanAnyPieceIsBad) {
  Reassembler r;
  const Bytes bytes(20'000);
  const wire::FragmentHeader message{MessageId{1}, 0,         20'000,
                                     40'000,       1'000'000, wire::MessageKind::kPlain};
  EXPECT_EQ(r.add(TimePoint{1s}, packet(message, 0, bytes), kNoClocks).result, Result::kBad);
  EXPECT_EQ(r.add(TimePoint{1s}, packet(message, 2, bytes), kNoClocks).result, Result::kBad);
  EXPECT_EQ(r.bytes(), 0U);
}

}  // namespace
}  // namespace interneuron::flow::reassembler_bounds_test
