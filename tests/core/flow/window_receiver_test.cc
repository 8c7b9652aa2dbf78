#include "core/flow/windows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "core/code/field.h"
#include "core/wire/source.h"

namespace interneuron::flow::window_receiver_test {
namespace {

using namespace std::chrono_literals;

constexpr TimePoint kStart{1s};

struct Piece {
  wire::FragmentHeader fragment;
  Bytes bytes;
  wire::Data data() const { return {fragment, bytes}; }
  Bytes source() const {
    const wire::SourceHeader head = wire::source_header(fragment);
    Bytes out(head.begin(), head.end());
    out.insert(out.end(), bytes.begin(), bytes.end());
    return out;
  }
};

// Messages of some pieces each, and the symbols over them.
struct Flow {
  std::vector<std::vector<Piece>> messages;
  WindowReceiver receiver;
  // What was computed, by message and index.
  std::map<std::pair<std::uint32_t, int>, Bytes> computed;
  std::mt19937_64 rng{5};

  explicit Flow(std::size_t count, std::size_t size = 2500, std::uint16_t chunk = 1000) {
    for (std::uint32_t m = 0; m < count; ++m) {
      messages.emplace_back();
      for (std::uint16_t i = 0; i * chunk < size; ++i) {
        Piece piece;
        piece.fragment = {MessageId{m}, i,
                          chunk,        static_cast<std::uint32_t>(size),
                          60'000,       wire::MessageKind::kPlain};
        piece.bytes.resize(piece.fragment.bytes());
        for (std::byte& b : piece.bytes) b = static_cast<std::byte>(rng());
        messages.back().push_back(std::move(piece));
      }
    }
  }
  // Covers these messages whole.
  std::pair<wire::WindowHeader, Bytes> symbol(std::size_t from, std::size_t to, std::uint8_t row) {
    wire::WindowHeader header;
    header.row = row;
    for (std::size_t m = from; m < to; ++m) {
      header.messages.push_back({MessageId{static_cast<std::uint32_t>(m)},
                                 static_cast<std::uint8_t>((1U << messages[m].size()) - 1)});
    }
    Bytes bytes;
    header.for_each([&](std::size_t column, MessageId id, std::uint8_t index) {
      const Bytes source = messages[id.value][index].source();
      bytes.resize(std::max(bytes.size(), source.size()));
      code::add_multiple(bytes, source, code::coefficient(row, column));
    });
    return {header, bytes};
  }
  void take(std::size_t from, std::size_t to, std::uint8_t row, TimePoint now = kStart) {
    const auto [header, bytes] = symbol(from, to, row);
    receiver.symbol(now, {header, bytes});
    collect();
  }
  void bring(std::size_t m, const std::set<int>& lost = {}) {
    for (const Piece& piece : messages[m]) {
      if (!lost.contains(piece.fragment.index)) receiver.piece(piece.data());
    }
    collect();
  }
  void collect() {
    while (const auto data = receiver.poll()) {
      const auto& f = data->fragment;
      const Piece& piece = messages.at(f.message.value).at(f.index);
      EXPECT_EQ(f, piece.fragment);
      EXPECT_TRUE(std::ranges::equal(data->bytes, piece.bytes));
      computed[{f.message.value, f.index}] = Bytes(data->bytes.begin(), data->bytes.end());
    }
  }
  // A symbol has come before, so that pieces are kept.
  void begin() { take(messages.size() - 1, messages.size(), 0); }
};

TEST(WindowReceiver, ComputesALostPiece) {
  Flow f(5);
  f.begin();
  f.bring(0);
  f.bring(1, {2});
  f.bring(2);
  EXPECT_TRUE(f.computed.empty());
  f.take(0, 3, 1);
  ASSERT_EQ(f.computed.size(), 1U);
  EXPECT_TRUE(f.computed.contains({1, 2}));
}

TEST(WindowReceiver, SymbolsMayComeBeforePieces) {
  Flow f(5);
  f.begin();
  f.take(0, 3, 1);
  f.bring(2);
  f.bring(0, {0});
  EXPECT_TRUE(f.computed.empty());
  f.bring(1);
  ASSERT_EQ(f.computed.size(), 1U);
  EXPECT_TRUE(f.computed.contains({0, 0}));
}

TEST(WindowReceiver, AsManySymbolsAsLossesComputeThem) {
  Flow f(9);
  f.begin();
  for (std::size_t m = 0; m < 8; ++m) f.bring(m, m % 2 == 0 ? std::set<int>{1} : std::set<int>{});
  for (std::uint8_t row = 1; row < 4; ++row) f.take(0, 8, row);
  EXPECT_TRUE(f.computed.empty());
  f.take(0, 8, 4);
  EXPECT_EQ(f.computed.size(), 4U);
}

TEST(WindowReceiver, WindowsThatOverlapAreCombined) {
  Flow f(7);
  f.begin();
  f.bring(0);
  f.bring(1, {0});
  f.bring(2, {1});
  f.bring(3);
  f.take(0, 3, 1);
  EXPECT_TRUE(f.computed.empty());
  f.take(1, 4, 2);
  EXPECT_EQ(f.computed.size(), 2U);
}

TEST(WindowReceiver, WhatWasComputedHelpsWithOthers) {
  Flow f(7);
  f.begin();
  for (const std::size_t m : {0U, 2U, 3U}) f.bring(m);
  f.bring(1, {0});
  // One piece comes late, of a message of which nothing else has come.
  f.take(1, 6, 1);
  f.bring(4, {2});
  f.bring(5);
  EXPECT_TRUE(f.computed.empty());
  f.take(0, 3, 2);
  EXPECT_EQ(f.computed.size(), 2U);
}

TEST(WindowReceiver, KeepsNothingBeforeTheFirstSymbolAndForgetsAfterThePause) {
  Flow f(4);
  f.bring(0);
  EXPECT_EQ(f.receiver.bytes(), 0U);
  EXPECT_FALSE(f.receiver.next_timeout());
  f.take(0, 1, 0);
  EXPECT_EQ(f.receiver.bytes(), WindowReceiver::kHeld);
  ASSERT_EQ(f.receiver.next_timeout(), kStart + WindowReceiver::kIdle);
  f.receiver.handle_timeout(kStart + WindowReceiver::kIdle - 1ns);
  EXPECT_GT(f.receiver.bytes(), 0U);
  f.receiver.handle_timeout(kStart + WindowReceiver::kIdle);
  EXPECT_EQ(f.receiver.bytes(), 0U);
  EXPECT_FALSE(f.receiver.next_timeout());
}

// Whoever asks stops when there is nothing more.
TEST(WindowReceiver, ComputesAnyNumberOneAfterTheOther) {
  Flow f(200, 500);
  f.begin();
  for (std::size_t m = 1; m < 199; ++m) {
    f.bring(m - 1);
    const auto [header, bytes] = f.symbol(m - 1, m + 1, static_cast<std::uint8_t>(m % 55));
    EXPECT_FALSE(f.receiver.has_computed());
    f.receiver.symbol(kStart, {header, bytes});
    ASSERT_TRUE(f.receiver.has_computed());
    ASSERT_TRUE(f.receiver.poll());
  }
}

TEST(WindowReceiver, WithoutRoomNothingBegins) {
  Flow f(4);
  const auto [header, bytes] = f.symbol(0, 1, 0);
  f.receiver.symbol(kStart, {header, bytes}, WindowReceiver::kHeld - 1);
  EXPECT_EQ(f.receiver.bytes(), 0U);
  f.receiver.symbol(kStart, {header, bytes}, WindowReceiver::kHeld);
  EXPECT_EQ(f.receiver.bytes(), WindowReceiver::kHeld);
  // What holds it already needs no more.
  f.receiver.symbol(kStart, {header, bytes}, 0);
  f.bring(0, {1});
  EXPECT_EQ(f.computed.size(), 1U);
}

TEST(WindowReceiver, LargeMessagesAndSymbolsOfTheirOwnAreNotKept) {
  Flow f(12, 1000, 1000);
  f.begin();
  f.bring(0);
  wire::FragmentHeader large{MessageId{50}, 0, 100, 900, 60'000, wire::MessageKind::kPlain};
  const Bytes bytes(100);
  // As many as would push out everything.
  for (std::uint16_t i = 0; i < 200; ++i) {
    large.message = MessageId{50U + i};
    f.receiver.piece({large, bytes});
    wire::FragmentHeader symbol{MessageId{500U + i}, 3, 100, 250, 60'000};
    f.receiver.piece({symbol, bytes});
  }
  f.take(0, 2, 1);
  EXPECT_TRUE(f.computed.contains({1, 0}));
}

TEST(WindowReceiver, SymbolsThatLieMakeNoPieces) {
  Flow f(6);
  f.begin();
  f.bring(0);
  f.bring(1, {0});
  auto [header, bytes] = f.symbol(0, 2, 1);
  Bytes wrong = bytes;
  // The fields of the missing piece.
  for (std::size_t i = 0; i < wire::kSourceHeaderBytes; ++i) wrong[i] ^= std::byte{0x5a};
  f.receiver.symbol(kStart, {header, wrong});
  EXPECT_FALSE(f.receiver.poll());
  // Shorter than what it covers.
  f.receiver.symbol(kStart, {header, ByteView(bytes).first(500)});
  EXPECT_FALSE(f.receiver.poll());
  // It did no harm.
  f.take(0, 2, 2);
  EXPECT_EQ(f.computed.size(), 1U);
}

TEST(WindowReceiver, SymbolsOfNothingPushOutOnlySymbols) {
  Flow f(4);
  f.begin();
  f.bring(0, {0});
  wire::WindowHeader nothing;
  for (std::uint32_t i = 0; i < 16; ++i) nothing.messages.push_back({MessageId{1000 + i}, 0b11});
  const Bytes bytes(1400, std::byte{7});
  for (std::uint32_t i = 0; i < 1000; ++i) {
    nothing.row = static_cast<std::uint8_t>(i % 55);
    nothing.messages[0].message = MessageId{1000 - i % 100};
    f.receiver.symbol(kStart, {nothing, bytes});
    EXPECT_FALSE(f.receiver.poll());
  }
  f.take(0, 1, 1);
  EXPECT_TRUE(f.computed.contains({0, 0}));
}

// Any symbols and pieces in any order do no harm.
TEST(WindowReceiver, AnythingIsTaken) {
  std::mt19937_64 rng(9);
  WindowReceiver receiver;
  TimePoint now = kStart;
  for (int turn = 0; turn < 20'000; ++turn) {
    Bytes bytes(12 + rng() % 60);
    for (std::byte& b : bytes) b = static_cast<std::byte>(rng() % 3);
    if (rng() % 2 == 0) {
      const auto chunk = static_cast<std::uint16_t>(1 + rng() % 20);
      wire::FragmentHeader f{MessageId{static_cast<std::uint32_t>(rng() % 6)},
                             static_cast<std::uint16_t>(rng() % 4), chunk,
                             static_cast<std::uint32_t>(1 + rng() % 60), 1000};
      if (f.is_repair()) continue;
      bytes.resize(f.bytes());
      receiver.piece({f, bytes});
    } else {
      wire::WindowHeader header;
      header.row = static_cast<std::uint8_t>(rng() % 55);
      auto message = static_cast<std::uint32_t>(rng() % 4);
      for (auto n = 1 + rng() % 3; n > 0; --n, ++message) {
        header.messages.push_back({MessageId{message}, static_cast<std::uint8_t>(1 + rng() % 15)});
      }
      receiver.symbol(now, {header, bytes});
    }
    while (const auto data = receiver.poll()) {
      ASSERT_EQ(data->bytes.size(), data->fragment.bytes());
      ASSERT_FALSE(data->fragment.is_repair());
    }
    now += 1ms;
  }
}

}  // namespace
}  // namespace interneuron::flow::window_receiver_test
