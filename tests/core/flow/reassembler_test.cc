#include "core/flow/reassembler.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "core/wire/round_header.h"

namespace interneuron::flow::receiver_test::reassembler_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

constexpr std::uint16_t kChunk = 100;
constexpr ClockBounds kNoClocks{};

struct Cut {
  Bytes bytes;
  MessageId id{};
  std::uint32_t lifetime_us = 130'000;

  std::uint16_t count() const {
    return static_cast<std::uint16_t>((bytes.size() + kChunk - 1) / kChunk);
  }
  wire::Data piece(std::size_t index) const {
    wire::Data d;
    d.fragment = {id, static_cast<std::uint16_t>(index), kChunk,
                  static_cast<std::uint32_t>(bytes.size()), lifetime_us};
    d.bytes = ByteView(bytes).subspan(index * kChunk,
                                      std::min<std::size_t>(kChunk, bytes.size() - index * kChunk));
    return d;
  }
};

Bytes noise(std::size_t size, std::uint32_t seed) {
  std::mt19937 rng(seed);
  Bytes out(size);
  for (std::byte& b : out) b = static_cast<std::byte>(rng());
  return out;
}

using Result = Reassembler::Result;

Bytes joined(const wire::MessageBytes& message) {
  Bytes out(message.header.begin(), message.header.end());
  out.insert(out.end(), message.payload.begin(), message.payload.end());
  return out;
}

RC_GTEST_PROP(Reassembler, PutsPiecesTogetherInAnyOrder, ()) {
  const Cut cut{
      noise(*rc::gen::inRange<std::size_t>(1, 3000), *rc::gen::arbitrary<std::uint32_t>()),
      MessageId{7}};
  std::vector<std::size_t> order(cut.count());
  std::iota(order.begin(), order.end(), 0U);
  std::shuffle(order.begin(), order.end(), std::mt19937(*rc::gen::arbitrary<std::uint32_t>()));
  Reassembler r;
  for (std::size_t i = 0; i < order.size(); ++i) {
    auto outcome = r.add(at(0ms), cut.piece(order[i]), kNoClocks);
    if (i + 1 < order.size()) {
      RC_ASSERT(outcome.result == Result::kStored);
      RC_ASSERT(r.add(at(0ms), cut.piece(order[i]), kNoClocks).result == Result::kDuplicate);
    } else {
      RC_ASSERT(outcome.result == Result::kComplete);
      RC_ASSERT(joined(outcome.message) == cut.bytes);
    }
  }
  RC_ASSERT(r.bytes() == 0U);
  RC_ASSERT(!r.next_timeout());
  RC_ASSERT(r.add(at(0ms), cut.piece(0), kNoClocks).result == Result::kDuplicate);
}

TEST(Reassembler, PiecesThatContradictTheFirstAreBadAndItIsCompletedWithoutThem) {
  Reassembler r;
  const Cut cut{noise(250, 1), MessageId{1}};
  r.add(at(0ms), cut.piece(0), kNoClocks);
  wire::Data other = cut.piece(1);
  other.fragment.size = 251;
  EXPECT_EQ(r.add(at(0ms), other, kNoClocks).result, Result::kBad);
  other = cut.piece(1);
  other.fragment.chunk = 50;
  other.bytes = other.bytes.first(50);
  EXPECT_EQ(r.add(at(0ms), other, kNoClocks).result, Result::kBad);
  r.add(at(0ms), cut.piece(1), kNoClocks);
  EXPECT_EQ(joined(r.add(at(0ms), cut.piece(2), kNoClocks).message), cut.bytes);
}

TEST(Reassembler, HoldsNoMoreThanItsBound) {
  Reassembler r;
  const Bytes piece(1352);
  for (std::uint32_t id = 0; id < 1000; ++id) {
    wire::Data d{.fragment = {MessageId{id}, 1, 1352, 1000 * 1352, UINT32_MAX}, .bytes = piece};
    const Result result = r.add(at(0ms), d, kNoClocks).result;
    EXPECT_EQ(result, id < Reassembler::kMaxPartials ? Result::kStored : Result::kRefused);
  }
  // What is claimed costs little, and what comes of it until it is too much.
  EXPECT_LE(r.bytes(), Reassembler::kMaxPartials * 8 * 1024);
  for (std::uint16_t index = 2; index < 100; ++index) {
    for (std::uint32_t id = 0; id < Reassembler::kMaxPartials; ++id) {
      wire::Data d{.fragment = {MessageId{id}, index, 1352, 1000 * 1352, UINT32_MAX},
                   .bytes = piece};
      r.add(at(0ms), d, kNoClocks);
      ASSERT_LE(r.bytes(), Reassembler::kMaxBytes);
    }
  }
  EXPECT_GE(r.bytes(), Reassembler::kMaxBytes / 2);
}

// The attack in 49 bytes: 8 MB for more than an hour.
TEST(Reassembler, AClaimCostsNextToNothingAndIsForgottenSoon) {
  for (const std::uint16_t chunk : {std::uint16_t{130}, std::uint16_t{1347}}) {
    Reassembler r;
    wire::Data d;
    d.fragment = {MessageId{1}, 0, chunk, kMaxMessageBytes, UINT32_MAX};
    d.fragment.index = static_cast<std::uint16_t>(d.fragment.count() - 1);
    const Bytes piece(d.fragment.bytes());
    d.bytes = piece;
    EXPECT_EQ(r.add(at(0ms), d, kNoClocks).result, Result::kStored);
    EXPECT_LE(r.bytes(), 16U * 1024);
    EXPECT_EQ(r.expire(at(kLongestBelieved)), 1U);
  }
}

// One that lives for longer does so as long as it grows.
TEST(Reassembler, ALongMessageLivesAsLongAsItGrows) {
  Reassembler r;
  const Cut cut{noise(1000, 1), MessageId{1}};
  const auto add = [&](Duration now, std::size_t piece) {
    wire::Data d = cut.piece(piece);
    d.fragment.lifetime_us = 30'000'000;
    return r.add(at(now), d, kNoClocks).result;
  };
  EXPECT_EQ(add(0s, 0), Result::kStored);
  EXPECT_EQ(add(9s, 1), Result::kStored);
  EXPECT_EQ(r.next_timeout(), at(19s));
  EXPECT_EQ(add(10s, 1), Result::kDuplicate);
  EXPECT_EQ(r.next_timeout(), at(19s));
  EXPECT_EQ(add(18s, 2), Result::kStored);
  // But no longer than it may.
  EXPECT_EQ(add(27s, 3), Result::kStored);
  EXPECT_EQ(r.expire(at(30s)), 1U);
}

// A message whose pieces no datagram can bring.
TEST(Reassembler, PiecesThatAreLongerThanAnyDatagramAreBad) {
  Reassembler r;
  wire::Data d;
  d.fragment = {MessageId{1}, 1, UINT16_MAX, UINT16_MAX + 1, UINT32_MAX};
  const Bytes piece(1);
  d.bytes = piece;
  EXPECT_EQ(r.add(at(0ms), d, kNoClocks).result, Result::kBad);
  EXPECT_EQ(r.bytes(), 0U);
}

// Refused as a whole, whatever of it is there.
TEST(Reassembler, WhatIsRefusedIsDropped) {
  for (const auto kind : {wire::MessageKind::kPlain, wire::MessageKind::kRound}) {
    Reassembler r;
    const Cut cut{noise(250, 1), MessageId{1}};
    wire::Data d = cut.piece(1);
    d.fragment.kind = kind;
    r.add(at(0ms), d, kNoClocks);
    r.refuse(d.fragment);
    EXPECT_EQ(r.bytes(), 0U);
    EXPECT_EQ(r.messages(), 0U);
    EXPECT_EQ(r.add(at(0ms), d, kNoClocks).result, Result::kDuplicate);
  }
}

// A message that its sender has given up must not keep out the first fragments of the next one.
TEST(Reassembler, WhatExpiresSoonerMakesRoom) {
  Reassembler r;
  const Bytes piece(1352);
  const auto begin = [&](std::uint32_t id, Duration now) {
    wire::Data d{.fragment = {MessageId{id}, 1, 1352, 4000 * 1352, 1'000'000}, .bytes = piece};
    const Result first = r.add(at(now), d, kNoClocks).result;
    Result last = first;
    for (std::uint16_t i = 2; i < 4000 && last == Result::kStored; ++i) {
      d.fragment.index = i;
      last = r.add(at(now), d, kNoClocks).result;
    }
    return last;
  };
  EXPECT_EQ(begin(1, 0ms), Result::kStored);
  EXPECT_EQ(begin(2, 900ms), Result::kStored);
  EXPECT_EQ(begin(1, 900ms), Result::kDuplicate) << "it has gone";
  EXPECT_EQ(begin(3, 900ms), Result::kRefused) << "it expires no later than the one there is";
  EXPECT_LE(r.bytes(), Reassembler::kMaxBytes);
}

TEST(Reassembler, WhatMakesRoomIsToldOf) {
  Reassembler r;
  const Bytes piece(1000);
  const auto begin = [&](std::uint32_t id, Duration lifetime) {
    wire::Data d{{MessageId{id}, 0, 1000, 5'000'000}, piece};
    d.fragment.lifetime_us = static_cast<std::uint32_t>(lifetime / 1us);
    for (std::uint16_t i = 1; i < 4999; ++i) {
      d.fragment.index = i;
      r.add(at(0ms), d, kNoClocks);
    }
    d.fragment.index = 0;
    return r.add(at(0ms), d, kNoClocks).result;
  };
  EXPECT_EQ(begin(1, 100ms), Result::kStored);
  EXPECT_FALSE(r.poll_forgotten());
  EXPECT_EQ(begin(2, 900ms), Result::kStored);
  EXPECT_EQ(r.poll_forgotten(), MessageId{1});
  EXPECT_FALSE(r.poll_forgotten());
}

TEST(Reassembler, APlainMessageThatWasRefusedIsNeverComplete) {
  for (const auto kind : {wire::MessageKind::kPlain, wire::MessageKind::kRound}) {
    Reassembler r;
    const Bytes piece(1000);
    wire::Data d{{MessageId{1}, 0, 1000, 1'000}, piece};
    d.fragment.kind = kind;
    EXPECT_EQ(r.add(at(0ms), d, kNoClocks, 999).result, Result::kRefused);
    EXPECT_EQ(r.add(at(1ms), d, kNoClocks).result,
              kind == wire::MessageKind::kPlain ? Result::kDuplicate : Result::kComplete);
  }
}

TEST(Reassembler, WhatWasRefusedStaysSoHoweverManyOthersAreComplete) {
  Reassembler r;
  const Bytes piece(1000);
  wire::Data late{{MessageId{1}, 0, 1000, 1'000}, piece};
  late.fragment.kind = wire::MessageKind::kPlain;
  wire::Data expired{{MessageId{2}, 0, 1000, 2'000}, piece};
  expired.fragment.kind = wire::MessageKind::kPlain;
  EXPECT_EQ(r.add(at(0ms), late, kNoClocks, 999).result, Result::kRefused);
  EXPECT_EQ(r.add(at(0ms), expired, kNoClocks).result, Result::kStored);
  EXPECT_EQ(r.expire(at(1s)), 1U);
  wire::Data other = late;
  for (std::uint32_t id = 10; id < 10 + 2 * Reassembler::kBuried; ++id) {
    other.fragment.message = MessageId{id};
    EXPECT_EQ(r.add(at(1s), other, kNoClocks).result, Result::kComplete);
  }
  EXPECT_EQ(r.add(at(1s), late, kNoClocks).result, Result::kDuplicate);
  EXPECT_EQ(r.add(at(1s), expired, kNoClocks).result, Result::kDuplicate);
}

TEST(Reassembler, NoLifetimeIsLongerThanADeadlineCanBe) {
  Reassembler r;
  const Bytes piece(1000);
  wire::Data d{{MessageId{1}, 0, 1000, 2'000, UINT32_MAX}, piece};
  EXPECT_EQ(r.add(at(0ms), d, kNoClocks).result, Result::kStored);
  EXPECT_EQ(r.expire(at(1h + 10ms)), 1U);
}

TEST(Reassembler, ManySmallPromisesAreBoundedToo) {
  // Two bytes each, for more than an hour: what is kept beside the bytes must not grow without
  // bound.
  Reassembler r;
  const Bytes piece(1);
  std::size_t stored = 0;
  for (std::uint32_t id = 0; id < 100'000; ++id) {
    wire::Data d{.fragment = {MessageId{id}, 0, 1, 2, UINT32_MAX}, .bytes = piece};
    if (r.add(at(0ms), d, kNoClocks).result == Result::kStored) ++stored;
  }
  EXPECT_EQ(stored, Reassembler::kMaxPartials);
}

TEST(Reassembler, TheLargestMessageFits) {
  Reassembler r;
  wire::Data d;
  const Bytes piece(1352);
  const std::size_t size = kMaxMessageBytes + wire::kRoundHeaderBytes;
  d.fragment = {MessageId{1}, 0, 1352, static_cast<std::uint32_t>(size), 1000};
  for (std::uint16_t i = 0; i < d.fragment.count(); ++i) {
    d.fragment.index = i;
    d.bytes = ByteView(piece).first(d.fragment.bytes());
    const bool is_last = i + 1 == d.fragment.count();
    EXPECT_EQ(r.add(at(0ms), d, kNoClocks).result, is_last ? Result::kComplete : Result::kStored);
  }
  EXPECT_EQ(r.bytes(), 0U);
}

TEST(Reassembler, ALargeClaimIsRefusedWithoutOverflow) {
  Reassembler r;
  const Bytes piece(UINT16_MAX);
  wire::Data d{.fragment = {MessageId{1}, 0, UINT16_MAX, UINT32_MAX, 1}, .bytes = piece};
  EXPECT_EQ(r.add(at(0ms), d, kNoClocks).result, Result::kRefused);
  EXPECT_EQ(r.bytes(), 0U);
}

TEST(Reassembler, WithoutAClockAMessageExpiresItsLifetimeAfterItsFirstPiece) {
  Reassembler r;
  const Cut cut{noise(250, 1), MessageId{1}};
  r.add(at(10ms), cut.piece(2), kNoClocks);
  r.add(at(90ms), cut.piece(1), kNoClocks);  // does not prolong it
  EXPECT_EQ(r.next_timeout(), at(140ms));
  EXPECT_EQ(r.expire(at(140ms - 1ns)), 0U);
  EXPECT_EQ(r.expire(at(140ms)), 1U);
  EXPECT_EQ(r.bytes(), 0U);
  EXPECT_EQ(r.add(at(141ms), cut.piece(0), kNoClocks).result, Result::kDuplicate);
}

constexpr SessionId kSelf{1};
constexpr SessionId kPeer{2};

// A message of 250 bytes that opens with a round header: t0 of `origin`, D_N = 130 ms.
Cut with_header(SessionId origin, PeerTime t0) {
  wire::RoundHeader h{
      .round = {origin, PipelineId{0}, RoundId{0}}, .t0 = t0, .deadline_us = 130'000};
  Cut cut{Bytes(250), MessageId{1}};
  wire::write_round_header(std::span(cut.bytes).first<wire::kRoundHeaderBytes>(), h);
  return cut;
}

TEST(Reassembler, ExpiresByTheOriginsClockOnceTheHeaderIsThere) {
  // Own clock - peer's is at most 1 h + 20 ms.
  const ClockBounds clocks{kSelf, kPeer, 1h + 20ms};
  const Cut cut = with_header(kPeer, PeerTime{5s});
  Reassembler r;
  const TimePoint first = at(1h + 5s + 100ms);
  r.add(first, cut.piece(1), clocks);
  EXPECT_EQ(r.next_timeout(), first + 130ms);
  r.add(first + 1ms, cut.piece(0), clocks);
  EXPECT_EQ(r.next_timeout(), at(1h + 5s + 20ms + 130ms + 2ms));
}

TEST(Reassembler, ButNeverLaterThanItsLifetime) {
  const ClockBounds clocks{kSelf, kPeer, 100s};
  const Cut cut = with_header(kPeer, PeerTime{5s});
  Reassembler r;
  r.add(at(6s), cut.piece(0), clocks);
  EXPECT_EQ(r.next_timeout(), at(6s + 130ms));
}

TEST(Reassembler, OwnRoundsNeedNoClockAndUnknownOriginsHaveNone) {
  const ClockBounds clocks{kSelf, kPeer, std::nullopt};
  Reassembler r;
  r.add(at(5s + 100ms), with_header(kSelf, PeerTime{5s}).piece(0), clocks);
  EXPECT_EQ(r.next_timeout(), at(5s + 132ms));
  Reassembler other;
  other.add(at(5s + 100ms), with_header(SessionId{77}, PeerTime{5s}).piece(0), clocks);
  EXPECT_EQ(other.next_timeout(), at(5s + 230ms));
}

RC_GTEST_PROP(Reassembler, AnyOriginTimeIsSurvived, (std::int64_t t0, std::int64_t hi)) {
  Reassembler r;
  r.add(at(1s), with_header(kPeer, PeerTime{Duration{t0}}).piece(0), {kSelf, kPeer, Duration{hi}});
  RC_ASSERT(r.next_timeout() <= at(1s + 130ms));
  r.expire(at(1s + 130ms));
  RC_ASSERT(r.bytes() == 0U);
}

TEST(Reassembler, RemembersTheLastFiveHundredMessages) {
  Reassembler r;
  Cut cut{noise(10, 1)};
  for (std::uint32_t id = 0; id < 513; ++id) {
    cut.id = MessageId{id};
    EXPECT_EQ(r.add(at(0ms), cut.piece(0), kNoClocks).result, Result::kComplete);
  }
  cut.id = MessageId{1};
  EXPECT_EQ(r.add(at(0ms), cut.piece(0), kNoClocks).result, Result::kDuplicate);
  cut.id = MessageId{0};
  EXPECT_EQ(r.add(at(0ms), cut.piece(0), kNoClocks).result, Result::kComplete);
}

TEST(Reassembler, ResetForgetsEverything) {
  Reassembler r;
  const Cut cut{noise(250, 1), MessageId{1}};
  r.add(at(0ms), cut.piece(0), kNoClocks);
  r = Reassembler();
  EXPECT_EQ(r.bytes(), 0U);
  EXPECT_FALSE(r.next_timeout());
  EXPECT_EQ(r.add(at(0ms), cut.piece(0), kNoClocks).result, Result::kStored);
}

}  // namespace
}  // namespace interneuron::flow::receiver_test::reassembler_test
