#include "core/messages/books.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <set>

namespace interneuron::received_messages_test {
namespace {

using messages::ReceivedMessages;

using namespace std::chrono_literals;
using Verdict = ReceivedMessages::Verdict;

constexpr PeerId kPeer{1};
constexpr PeerId kOther{2};

wire::PlainHeader message(std::uint32_t id, std::uint8_t variant = 0) {
  return wire::PlainHeader{.id = id, .deadline_us = 100'000, .variant = variant};
}

wire::PlainHeader newest(std::uint32_t id, std::uint16_t channel) {
  wire::PlainHeader h = message(id);
  h.channel = channel;
  h.newest_only = true;
  return h;
}

TEST(ReceivedMessages, TheFirstVariantIsDeliveredAndABetterOneLaterIsNot) {
  ReceivedMessages in;
  EXPECT_EQ(in.judge(kPeer, message(7, 2), 10ms), Verdict::kDeliver);
  EXPECT_EQ(in.judge(kPeer, message(7, 0), 20ms), Verdict::kRepeated);
  EXPECT_EQ(in.judge(kOther, message(7, 0), 20ms), Verdict::kDeliver);
}

TEST(ReceivedMessages, NothingIsDeliveredAfterItsDeadline) {
  ReceivedMessages in;
  EXPECT_EQ(in.judge(kPeer, message(7), 100ms + 1ns), Verdict::kLate);
  EXPECT_EQ(in.judge(kPeer, message(7, 1), 100ms), Verdict::kDeliver);
  EXPECT_EQ(in.judge(kPeer, message(7), 101ms), Verdict::kLate);
  EXPECT_EQ(in.judge(kPeer, message(8), std::nullopt), Verdict::kDeliver);
}

TEST(ReceivedMessages, OrderIsNoneUnlessOnlyTheNewestCounts) {
  ReceivedMessages in;
  EXPECT_EQ(in.judge(kPeer, message(9), 1ms), Verdict::kDeliver);
  EXPECT_EQ(in.judge(kPeer, message(8), 1ms), Verdict::kDeliver);
  EXPECT_EQ(in.judge(kPeer, newest(12, 5), 1ms), Verdict::kDeliver);
  EXPECT_EQ(in.judge(kPeer, newest(11, 5), 1ms), Verdict::kSuperseded);
  EXPECT_EQ(in.judge(kPeer, newest(11, 6), 1ms), Verdict::kDeliver);
  EXPECT_EQ(in.judge(kPeer, message(10), 1ms), Verdict::kDeliver);
}

TEST(ReceivedMessages, OfManyChannelsTheLeastRecentlyDeliveredIsForgotten) {
  ReceivedMessages in;
  std::uint32_t id = 100;
  for (std::uint16_t channel = 0; channel <= ReceivedMessages::kMaxChannels; ++channel) {
    EXPECT_EQ(in.judge(kPeer, newest(id += 2, channel), 1ms), Verdict::kDeliver);
  }
  EXPECT_EQ(in.judge(kPeer, newest(103, 1), 1ms), Verdict::kSuperseded);
  EXPECT_EQ(in.judge(kPeer, newest(101, 0), 1ms), Verdict::kDeliver);
}

TEST(ReceivedMessages, WhatIsTooOldToTellIsNotTakenForDelivered) {
  ReceivedMessages in;
  EXPECT_EQ(in.judge(kPeer, message(10'000), 1ms), Verdict::kDeliver);
  EXPECT_EQ(in.judge(kPeer, message(10'000 - 4096), 1ms), Verdict::kTooOld);
  EXPECT_EQ(in.judge(kPeer, message(10'000 - 4095), 1ms), Verdict::kDeliver);
  EXPECT_EQ(in.judge(kPeer, message(10'000 - 4095), 1ms), Verdict::kRepeated);
}

TEST(ReceivedMessages, IdentifiersWrap) {
  ReceivedMessages in;
  EXPECT_EQ(in.judge(kPeer, newest(UINT32_MAX, 1), 1ms), Verdict::kDeliver);
  EXPECT_EQ(in.judge(kPeer, newest(0, 1), 1ms), Verdict::kDeliver);
  EXPECT_EQ(in.judge(kPeer, newest(UINT32_MAX, 1), 1ms), Verdict::kRepeated);
  EXPECT_EQ(in.judge(kPeer, message(UINT32_MAX - 1), 1ms), Verdict::kDeliver);
}

TEST(ReceivedMessages, ANewLifeOfThePeerBeginsAfresh) {
  ReceivedMessages in;
  in.judge(kPeer, message(7), 1ms);
  in.forget(kPeer);
  EXPECT_EQ(in.judge(kPeer, message(7), 1ms), Verdict::kDeliver);
}

RC_GTEST_PROP(ReceivedMessagesProperty, EachIdentifierIsDeliveredOnce, ()) {
  ReceivedMessages in;
  std::set<std::uint32_t> delivered;
  auto last = *rc::gen::arbitrary<std::uint32_t>();
  const auto steps = *rc::gen::container<std::vector<int>>(
      rc::gen::oneOf(rc::gen::inRange(-30, 40), rc::gen::inRange(-6000, 6000)));
  for (const int step : steps) {
    last += static_cast<std::uint32_t>(step);
    if (in.judge(kPeer, message(last), 1ms) != Verdict::kDeliver) continue;
    RC_ASSERT(delivered.insert(last).second);
  }
}

}  // namespace
}  // namespace interneuron::received_messages_test
