#include "core/flow/arrivals.h"

#include <gtest/gtest.h>

namespace interneuron::flow::receipts_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

wire::Feedback told(Receipts& receipts, Duration now, bool all_paths = true) {
  wire::Feedback feedback;
  receipts.tell(at(now), all_paths, feedback);
  return feedback;
}

TEST(Receipts, EachMessageIsToldInThreePackets) {
  Receipts receipts;
  receipts.complete(at(1s), MessageId{7});
  receipts.refuse(at(1s), MessageId{8});
  for (int i = 1; i <= 3; ++i) {
    const wire::Feedback feedback = told(receipts, 1s + i * 5ms);
    ASSERT_EQ(feedback.complete.size(), 1U);
    EXPECT_EQ(feedback.complete[0].message, MessageId{7});
    EXPECT_EQ(feedback.complete[0].ago_us, static_cast<std::uint32_t>(i) * 5000U);
    ASSERT_EQ(feedback.refused.size(), 1U);
    EXPECT_EQ(feedback.refused[0], MessageId{8});
  }
  EXPECT_EQ(told(receipts, 2s), wire::Feedback{});
}

TEST(Receipts, SayWhichMessagesWereDropped) {
  Receipts receipts;
  receipts.complete(at(1s), MessageId{7});
  receipts.complete(at(1s), MessageId{8});
  receipts.mark_dropped(MessageId{7});
  receipts.mark_dropped(MessageId{9});  // is not there
  const wire::Feedback feedback = told(receipts, 1s);
  ASSERT_EQ(feedback.complete.size(), 2U);
  EXPECT_TRUE(feedback.complete[0].dropped);
  EXPECT_FALSE(feedback.complete[1].dropped);
}

TEST(Receipts, AMessageIsRefusedOnceHoweverManyPiecesItHas) {
  Receipts receipts;
  for (int i = 0; i < 100; ++i) receipts.refuse(at(1s), MessageId{8});
  EXPECT_EQ(told(receipts, 1s).refused.size(), 1U);
}

TEST(Receipts, WhatDoesNotFitIsToldByTheNextPacket) {
  Receipts receipts;
  for (std::uint32_t i = 0; i < 100; ++i) {
    receipts.complete(at(1s), MessageId{i});
    receipts.refuse(at(1s), MessageId{i});
  }
  std::uint32_t complete = 0;
  std::uint32_t refused = 0;
  for (int packets = 0; receipts.has_untold(); ++packets) {
    ASSERT_LT(packets, 7);
    const wire::Feedback feedback = told(receipts, 1s);
    EXPECT_EQ(feedback.complete.size(), wire::kMaxComplete);
    EXPECT_EQ(feedback.refused.size(), wire::kMaxRefused);
    for (const auto& c : feedback.complete) complete += c.message == MessageId{complete} ? 1 : 0;
    for (const MessageId r : feedback.refused) refused += r == MessageId{refused} ? 1 : 0;
  }
  EXPECT_EQ(complete, 100U);
  EXPECT_EQ(refused, 100U);
}

TEST(Receipts, OfMoreThanMayWaitTheOldestAreNotTold) {
  Receipts receipts;
  for (std::uint32_t i = 0; i < 1000; ++i) receipts.complete(at(1s), MessageId{i});
  std::size_t told_of = 0;
  while (receipts.has_untold()) {
    const wire::Feedback feedback = told(receipts, 1s);
    EXPECT_TRUE(told_of > 0 || feedback.complete.front().message == MessageId{1000 - 256});
    told_of += feedback.complete.size();
  }
  EXPECT_EQ(told_of, 256U);
}

TEST(Receipts, ALongTimeAgoIsTheLongestThatCanBeTold) {
  Receipts receipts;
  receipts.complete(at(0s), MessageId{7});
  EXPECT_EQ(told(receipts, 100h).complete[0].ago_us, wire::kLongestAgo);
}

TEST(Receipts, FeedbackAboutOnePathTellsOnlyWhatTheOthersHaveLeft) {
  Receipts receipts;
  receipts.complete(at(1s), MessageId{7});
  receipts.refuse(at(1s), MessageId{8});
  EXPECT_EQ(told(receipts, 1s + Receipts::kLeftOver - 1ns, false), wire::Feedback{});
  const wire::Feedback feedback = told(receipts, 1s + Receipts::kLeftOver, false);
  EXPECT_EQ(feedback.complete.size(), 1U);
  EXPECT_EQ(feedback.refused.size(), 1U);
}

TEST(Receipts, ResetForgetsEverything) {
  Receipts receipts;
  receipts.complete(at(1s), MessageId{7});
  receipts.refuse(at(1s), MessageId{8});
  receipts = {};
  EXPECT_EQ(told(receipts, 1s), wire::Feedback{});
}

}  // namespace
}  // namespace interneuron::flow::receipts_test
