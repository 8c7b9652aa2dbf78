// What send() refuses, and the event that tells when a channel can send again.
#include <gtest/gtest.h>

#include "door.h"

namespace interneuron::refusal_test {
namespace {

TEST(Refusal, WhatIsWrongWithTheMessageItself) {
  Door d;
  EXPECT_EQ(d.send({}).status, SendStatus::kEmpty);
  EXPECT_EQ(d.send({Bytes{}}).status, SendStatus::kEmpty);
  EXPECT_EQ(d.send({Bytes(10), Bytes{}}).status, SendStatus::kEmpty);
  EXPECT_EQ(d.send({Bytes(kMaxMessageBytes + 1)}).status, SendStatus::kTooLarge);
  EXPECT_EQ(d.send(Variants(kMaxVariants + 1, Bytes(1))).status, SendStatus::kTooLarge);
  for (const Duration deadline : {Duration{0}, Duration{-1}}) {
    SendOptions options{.deadline = deadline};
    EXPECT_EQ(d.send({Bytes(1)}, options).status, SendStatus::kDeadlinePast);
  }
  SendOptions options{.policy = "no_such_policy"};
  EXPECT_THROW(d.send({Bytes(1)}, options), std::invalid_argument);
  d.pipe.run(1s);
  EXPECT_TRUE(d.came.empty());
  EXPECT_TRUE(d.fates.empty());
}

TEST(Refusal, AnUnknownPeerOrNoLink) {
  Door d;
  const PeerId peer = d.peer;
  d.peer = PeerId{77};
  EXPECT_EQ(d.send({Bytes(1)}).status, SendStatus::kNoPeer);
  d.peer = peer;
  d.pipe.cut = {kFast, kSlow};
  d.pipe.run(10s);
  EXPECT_EQ(d.send({Bytes(1)}).status, SendStatus::kNoLink);
  EXPECT_TRUE(d.can_send.empty());
  d.pipe.cut.clear();
  d.pipe.run(10s);
  ASSERT_EQ(d.can_send.size(), 1U);
  EXPECT_EQ(d.can_send[0].peer, peer);
  EXPECT_TRUE(d.send({Bytes(1)}).accepted());
}

TEST(Refusal, APolicyThatMayUseNoLink) {
  Door d;
  SendOptions options{.policy = "secure"};
  const SendResult result = d.send({Bytes(1)}, options);
  EXPECT_EQ(result.status, SendStatus::kLinkRestricted);
  EXPECT_EQ(result.reason, kInsecure);
}

TEST(Refusal, WhatCannotArriveIsRefusedAtOnce) {
  Door d;
  const SendResult result = d.send({Bytes(1)}, {.deadline = 1ms});
  EXPECT_EQ(result.status, SendStatus::kCannotArrive);
  ASSERT_TRUE(result.expected);
  EXPECT_GT(*result.expected, 1ms);
}

TEST(Refusal, MoreThanTheBudgetIsRefusedUntilSomethingIsSettled) {
  Door d;
  SendOptions options{.deadline = 1h, .channel = 3};
  std::size_t accepted = 0;
  SendStatus last{};
  for (int i = 0; i < 20; ++i) {
    const SendResult result = d.send({Bytes(kMaxMessageBytes)}, options);
    accepted += result.accepted() ? 1 : 0;
    last = result.status;
  }
  EXPECT_EQ(accepted, 8U);
  EXPECT_EQ(last, SendStatus::kOverBudget);
  EXPECT_TRUE(d.can_send.empty());
  for (const auto& [id, sent] : d.sent) {
    d.pipe.at(d.vehicle).cancel(d.pipe.local(d.vehicle), id);
  }
  d.pipe.flush(d.vehicle);
  d.pipe.run(100ms);
  ASSERT_EQ(d.can_send.size(), 1U);
  EXPECT_EQ(d.can_send[0].channel, 3);
}

TEST(Refusal, StatusesAndFatesHaveNames) {
  for (int i = 0; i <= static_cast<int>(SendStatus::kDeadlinePast); ++i) {
    EXPECT_GT(to_string(static_cast<SendStatus>(i)).size(), 3U);
  }
  EXPECT_EQ(to_string(Fate::kLate), "late");
  EXPECT_EQ(to_string(FateReason::kNone), "");
  EXPECT_EQ(to_string(FateReason::kPeerGone), "peer gone");
}

}  // namespace
}  // namespace interneuron::refusal_test
