// When packets are reported.
#include "core/peers/feedback_due.h"

#include <gtest/gtest.h>

#include "pipe.h"

namespace interneuron::feedback_due_test {
namespace {

using peers::FeedbackDue;

TimePoint at(Duration d) { return TimePoint{1s + d}; }

TEST(FeedbackDue, AfterFiveMillisecondsOrSixteenPackets) {
  FeedbackDue due(at(0s));
  EXPECT_FALSE(due.at());
  due.arrived(at(0s), false);
  EXPECT_EQ(due.at(), at(5ms));
  for (int i = 1; i < 15; ++i) due.arrived(at(1ms), false);
  EXPECT_EQ(due.at(), at(5ms));
  due.arrived(at(2ms), false);
  EXPECT_TRUE(due.is_due(at(2ms)));
  due.sent(at(2ms));
  EXPECT_FALSE(due.at());
  due.arrived(at(3ms), false);
  EXPECT_EQ(due.at(), at(8ms));
}

TEST(FeedbackDue, AGapAtOnceButNotTwiceInAMillisecond) {
  FeedbackDue due(at(0s));
  due.arrived(at(10ms), true);
  EXPECT_TRUE(due.is_due(at(10ms)));
  due.sent(at(10ms));
  due.arrived(at(10ms + 200us), true);
  EXPECT_EQ(due.at(), at(11ms));
}

// One feedback for a burst of a fast link, and not one for every 16 packets of it.
TEST(FeedbackDue, WaitsForTheRestOfABurst) {
  FeedbackDue due(at(0s));
  for (int i = 0; i < 127; ++i) due.arrived(at(i * 6us), false);
  EXPECT_EQ(due.at(), at(1ms));
  due.arrived(at(127 * 6us), false);
  EXPECT_TRUE(due.is_due(at(127 * 6us))) << "half of what one feedback can tell of";
}

TEST(FeedbackDue, AtOnceWhenABurstCompletesAMessage) {
  FeedbackDue due(at(0s));
  for (int i = 0; i < 15; ++i) due.arrived(at(0s), false);
  due.completed(at(0s));
  EXPECT_EQ(due.at(), at(5ms)) << "messages of few packets may be many";
  due.arrived(at(0s), false);
  due.completed(at(0s));
  EXPECT_TRUE(due.is_due(at(0s)));
}

}  // namespace
}  // namespace interneuron::feedback_due_test
