#include "core/messages/books.h"

#include <gtest/gtest.h>

namespace interneuron::sent_messages_test {
namespace {

using messages::SentMessages;

using namespace std::chrono_literals;

constexpr PeerId kPeer{1};

TimePoint at(Duration d) { return TimePoint{d}; }

SentMessages::Entry entry(std::initializer_list<std::uint32_t> messages) {
  SentMessages::Entry e{.peer = kPeer,
                        .channel = 7,
                        .newest_only = false,
                        .t0 = at(1s),
                        .deadline = at(1100ms),
                        .ends = at(1170ms),
                        .variants = {}};
  for (const std::uint32_t m : messages) {
    e.variants.push_back({MessageId{m}, static_cast<std::uint8_t>(e.variants.size())});
  }
  return e;
}

TEST(SentMessages, TheFirstVariantThatIsDeliveredIsTheFate) {
  SentMessages out;
  const SendId id = out.add(entry({10, 11}));
  const auto fate = out.delivered(kPeer, MessageId{11}, {30ms, 5ms});
  ASSERT_TRUE(fate);
  EXPECT_EQ(fate->id, id);
  EXPECT_EQ(fate->peer, kPeer);
  EXPECT_EQ(fate->channel, 7);
  EXPECT_EQ(fate->fate, Fate::kDelivered);
  EXPECT_EQ(fate->variant, 1);
  EXPECT_EQ(fate->age, 30ms);
  EXPECT_EQ(fate->age_error, 5ms);
  EXPECT_FALSE(out.delivered(kPeer, MessageId{10}, {}));
  EXPECT_FALSE(out.end(id, Fate::kUnknown, FateReason::kExpired));
  EXPECT_EQ(out.first_end(), std::nullopt);
  EXPECT_TRUE(out.to(kPeer).empty());
}

TEST(SentMessages, APeerWhoseFatesStayOpenLeavesRoomForOthers) {
  SentMessages out;
  std::uint32_t messages = 0;
  while (out.has_room(kPeer)) out.add(entry({++messages}));
  EXPECT_GE(messages, SentMessages::kMaxMessages / 2 - 1);
  EXPECT_LE(messages, SentMessages::kMaxMessages / 2);
  EXPECT_TRUE(out.has_room(PeerId{2}));
  out.end(SendId{1}, Fate::kUnknown, FateReason::kExpired);
  EXPECT_TRUE(out.has_room(kPeer));
}

TEST(SentMessages, AMessageIsDroppedWithTheLastOfItsVariants) {
  SentMessages out;
  out.add(entry({10, 11}));
  EXPECT_FALSE(out.dropped(kPeer, MessageId{10}, FateReason::kRefusedByPeer));
  EXPECT_FALSE(out.dropped(kPeer, MessageId{10}, FateReason::kRefusedByPeer));
  const auto fate = out.dropped(kPeer, MessageId{11}, FateReason::kCannotArrive);
  ASSERT_TRUE(fate);
  EXPECT_EQ(fate->fate, Fate::kDropped);
  EXPECT_EQ(fate->reason, FateReason::kCannotArrive);
}

TEST(SentMessages, LateSaysMoreThanDroppedAndLessThanDelivered) {
  SentMessages out;
  const SendId first = out.add(entry({10, 11}));
  EXPECT_FALSE(out.late(kPeer, MessageId{10}, {105ms, 5ms}));
  const auto late = out.end(first, Fate::kDropped, FateReason::kExpired);
  ASSERT_TRUE(late);
  EXPECT_EQ(late->fate, Fate::kLate);
  EXPECT_EQ(late->variant, 0);
  EXPECT_EQ(late->age, 105ms);
  out.add(entry({20, 21}));
  EXPECT_FALSE(out.late(kPeer, MessageId{20}, {105ms, 5ms}));
  EXPECT_EQ(out.delivered(kPeer, MessageId{21}, {90ms, 5ms})->fate, Fate::kDelivered);
}

TEST(SentMessages, WhereNothingWasHeardOfAVariantAnotherThatWasLateSaysNothing) {
  SentMessages out;
  const SendId id = out.add(entry({10, 11}));
  EXPECT_FALSE(out.late(kPeer, MessageId{10}, {105ms, 5ms}));
  EXPECT_EQ(out.end(id, Fate::kUnknown, FateReason::kExpired)->fate, Fate::kUnknown);
  // What was cancelled may come nevertheless.
  const SendId cancelled = out.add(entry({30, 31}));
  EXPECT_FALSE(out.late(kPeer, MessageId{30}, {105ms, 5ms}));
  const auto fate = out.end(cancelled, Fate::kDropped, FateReason::kCancelled);
  EXPECT_EQ(fate->fate, Fate::kDropped);
  EXPECT_EQ(fate->reason, FateReason::kCancelled);
  out.add(entry({20, 21}));
  EXPECT_FALSE(out.late(kPeer, MessageId{20}, {105ms, 5ms}));
  EXPECT_EQ(out.dropped(kPeer, MessageId{21}, FateReason::kExpired)->fate, Fate::kLate);
}

TEST(SentMessages, WhatIsNotInTheBooksIsIgnored) {
  SentMessages out;
  const SendId id = out.add(entry({10}));
  EXPECT_FALSE(out.delivered(PeerId{2}, MessageId{10}, {}));
  EXPECT_FALSE(out.late(kPeer, MessageId{11}, {}));
  EXPECT_FALSE(out.dropped(kPeer, MessageId{12}, FateReason::kExpired));
  EXPECT_EQ(out.find(SendId{id.value + 1}), nullptr);
  EXPECT_NE(out.find(kPeer, MessageId{10}), nullptr);
}

TEST(SentMessages, AreBounded) {
  SentMessages many;
  std::uint32_t messages = 0;
  for (std::uint32_t peer = 1; peer < 50; ++peer) {
    while (many.has_room(PeerId{peer})) {
      SentMessages::Entry one = entry({++messages});
      one.peer = PeerId{peer};
      many.add(one);
    }
  }
  EXPECT_LE(messages, SentMessages::kMaxMessages);
  EXPECT_GE(messages, SentMessages::kMaxMessages - 2);
}

TEST(SentMessages, TellsWhoseTimeIsOver) {
  SentMessages out;
  SentMessages::Entry later = entry({1});
  later.deadline = at(2s);
  later.ends = at(3s);
  const SendId second = out.add(later);
  const SendId first = out.add(entry({2}));
  EXPECT_EQ(out.first_end(), at(1170ms));
  EXPECT_FALSE(out.ended(at(1170ms - 1ns)));
  EXPECT_EQ(out.ended(at(1170ms)), first);
  EXPECT_EQ(out.to(kPeer), (std::vector<SendId>{second, first}));
}

}  // namespace
}  // namespace interneuron::sent_messages_test
