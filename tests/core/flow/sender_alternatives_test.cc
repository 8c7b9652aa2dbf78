#include <gtest/gtest.h>

#include "sender_support.h"

namespace interneuron::flow::sender_alternatives_test {
namespace {

// Path A at 10 Mbit/s and 10 ms one way: 100 pieces take 115 ms, and 10 of them 12 ms.
struct Slow : Paths {
  explicit Slow(bool loaded) {
    PathView v = view(10ms, 10);
    v.soon = v.rate;
    v.least_one_way = 10ms;
    v.loaded = loaded;
    sender.set_path(kA, v);
  }
  MessageId plain(std::size_t pieces, Duration deadline, const PathList& on = {kA}) {
    return sender.send(at(0s), {.deadline = at(deadline), .lifetime = deadline},
                       Bytes(pieces * kChunk), on, {}, wire::MessageKind::kPlain);
  }
  std::vector<MessageId> given_up() {
    std::vector<MessageId> out;
    while (const auto id = sender.poll_given_up()) out.push_back(*id);
    return out;
  }
};

TEST(SenderAlternatives, OneTakesThePlaceOfWhatCannotArriveOverAnyPath) {
  for (const bool loaded : {true, false}) {
    Slow p(loaded);
    const MessageId large = p.plain(100, 100ms);
    const MessageId small = p.sender.add_alternative(at(0s), large, Bytes(10 * kChunk));
    TimePoint now = at(0s);
    std::size_t pieces = 0;
    for (const auto& piece : p.drain(kA, now)) {
      EXPECT_EQ(piece.fragment.message, small);
      ++pieces;
    }
    EXPECT_EQ(pieces, 10U);
    EXPECT_EQ(p.given_up(), std::vector{large});
  }
}

TEST(SenderAlternatives, NoneIsSentWhereTheFirstCanArrive) {
  Slow p(true);
  const MessageId large = p.plain(100, 250ms);
  p.sender.add_alternative(at(0s), large, Bytes(10 * kChunk));
  TimePoint now = at(0s);
  for (const auto& piece : p.drain(kA, now)) EXPECT_EQ(piece.fragment.message, large);
  EXPECT_TRUE(p.given_up().empty());
  p.sender.handle_timeout(at(251ms));
  EXPECT_EQ(p.sender.bytes(), 0U);
}

TEST(SenderAlternatives, TheNextStandsByForTheOneBefore) {
  Slow p(true);
  const MessageId large = p.plain(100, 40ms);
  const MessageId medium = p.sender.add_alternative(at(0s), large, Bytes(50 * kChunk));
  const MessageId small = p.sender.add_alternative(at(0s), medium, Bytes(10 * kChunk));
  const auto piece = p.sender.poll(at(0s), kA);
  ASSERT_TRUE(piece);
  EXPECT_EQ(piece->fragment.message, small);
  EXPECT_EQ(p.given_up(), (std::vector{large, medium}));
}

TEST(SenderAlternatives, PiecesHandedOutOutliveAMessageThatIsGivenUp) {
  Slow p(true);
  const std::byte mark{7};
  p.sender.send(at(0s), {.deadline = at(120ms), .lifetime = 120ms}, Bytes(90 * kChunk, mark), {kA},
                {}, wire::MessageKind::kPlain);
  const auto piece = p.sender.poll(at(0s), kA);
  ASSERT_TRUE(piece);
  // The rest cannot arrive any more.
  EXPECT_FALSE(p.sender.poll(at(60ms), kA));
  EXPECT_EQ(p.given_up().size(), 1U);
  EXPECT_EQ(p.sender.bytes(), 0U);
  EXPECT_TRUE(std::ranges::all_of(piece->bytes.payload, [=](std::byte b) { return b == mark; }));
  p.sender.handle_timeout(at(61ms));
}

TEST(SenderAlternatives, WhereNoneCanArriveOverALoadedPathAllAreGivenUp) {
  Slow p(true);
  const MessageId large = p.plain(100, 15ms);
  const MessageId small = p.sender.add_alternative(at(0s), large, Bytes(10 * kChunk));
  EXPECT_FALSE(p.sender.poll(at(0s), kA));
  EXPECT_EQ(p.given_up(), (std::vector{large, small}));
  EXPECT_EQ(p.sender.bytes(), 0U);
}

TEST(SenderAlternatives, NothingTakesThePlaceOfWhatIsGoneOrGoesOverSeveralPaths) {
  Slow p(true);
  const MessageId gone = p.plain(100, 100ms);
  p.sender.cancel(gone);
  p.sender.add_alternative(at(0s), gone, Bytes(kChunk));
  EXPECT_TRUE(p.idle(at(0s)));
  const MessageId both = p.plain(100, 100ms, {kA, kB});
  p.sender.add_alternative(at(0s), both, Bytes(kChunk));
  EXPECT_FALSE(p.sender.poll(at(0s), kA));
  EXPECT_TRUE(p.given_up().empty());
  EXPECT_EQ(p.sender.poll(at(0s), kB)->fragment.message, both);
}

}  // namespace
}  // namespace interneuron::flow::sender_alternatives_test
