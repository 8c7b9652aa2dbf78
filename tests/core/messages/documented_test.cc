// What docs/messages.md says becomes of messages when something happens to a host or its clock;
// what send() refuses is in refusal_test.cc, and the rest of the table in send_test.cc.
#include <gtest/gtest.h>

#include "door.h"

namespace interneuron::documented_test {
namespace {

// Neither host calls its endpoint for so long.
void sleep_both(Door& d, Duration by) {
  for (const std::size_t host : {d.vehicle, d.road}) d.pipe.jump(host, by);
}

TEST(Documented, WhatWasUnderWayWhenTheHostSleptIsUnknownAtOnceAndNotDeliveredAfterwards) {
  Door d;
  const SendResult result = d.send({Bytes(100'000)});
  ASSERT_TRUE(result.accepted());
  sleep_both(d, 5s);
  d.pipe.run(5s);
  EXPECT_EQ(d.fate(result.id).fate, Fate::kUnknown);
  EXPECT_EQ(d.fates[result.id][0].at, d.sent[result.id].at);
  EXPECT_TRUE(d.came.empty());
  const SendResult again = d.send({Bytes(100)});
  ASSERT_TRUE(again.accepted());
  d.pipe.run(1s);
  EXPECT_EQ(d.fate(again.id).fate, Fate::kDelivered);
}

TEST(Documented, APeerThatSleptDropsWhatIsLateWhenItWakes) {
  Door d;
  const SendResult result = d.send({Bytes(100)});
  ASSERT_TRUE(result.accepted());
  d.pipe.jump(d.road, 5s);
  d.pipe.run(5s);
  EXPECT_TRUE(d.came.empty());
  EXPECT_EQ(d.fate(result.id).fate, Fate::kLate);
}

TEST(Documented, AfterAJumpOfThePeersClockMessagesAreDeliveredAgainWithinSeconds) {
  for (const Duration by : {Duration(10min), Duration(-10min)}) {
    Door d;
    d.pipe.jump(d.road, by);
    int delivered = 0;
    std::vector<SendId> ids;
    for (int i = 0; i < 60; ++i) {
      const SendResult result = d.send({Bytes(1'000)});
      // Neither is the jump a queue, nor what is sent ten times a second all that a link carries.
      EXPECT_TRUE(result.accepted()) << i << " " << to_string(result.status);
      if (result.accepted()) ids.push_back(result.id);
      d.pipe.run(100ms);
    }
    d.pipe.run(1s);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const Fate fate = d.fate(ids[i]).fate;
      EXPECT_TRUE(fate == Fate::kDelivered || fate == Fate::kLate) << to_string(fate);
      delivered += fate == Fate::kDelivered ? 1 : 0;
      EXPECT_TRUE(i + 20 < ids.size() || fate == Fate::kDelivered) << i;
    }
    EXPECT_EQ(d.came.size(), static_cast<std::size_t>(delivered));
  }
}

TEST(Documented, WhatNeverLeftBeforeAllLinksWentDownExpired) {
  Door d;
  const SendResult result = d.send({Bytes(kMaxMessageBytes)}, {.deadline = 1s});
  if (!result.accepted()) return;
  d.pipe.cut = {kFast, kSlow};
  d.pipe.run(3s);
  EXPECT_EQ(d.fate(result.id).fate, Fate::kDropped);
  EXPECT_EQ(d.fate(result.id).reason, FateReason::kExpired);
}

}  // namespace
}  // namespace interneuron::documented_test
