#include "lab/emu/queue.h"

#include <gtest/gtest.h>

namespace interneuron::emu::queue_time_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(QueueTime, CountsNothingAtFirst) {
  const QueueTime time;
  EXPECT_EQ(time.quantile(0.99), Duration{});
  EXPECT_EQ(time.mean(), Duration{});
}

TEST(QueueTime, WeighsInstantsAlike) {
  QueueTime time;
  time.add_empty({}, milliseconds(900));
  // A queue of 100 ms that empties: 10 % of the time, uniform from 100 ms to 0.
  time.add(milliseconds(900), seconds(1), seconds(1));
  EXPECT_EQ(time.counted(), seconds(1));
  EXPECT_EQ(time.quantile(0.5), Duration{});
  EXPECT_EQ(time.quantile(0.9), Duration{});
  EXPECT_EQ(time.quantile(0.95), milliseconds(50));
  EXPECT_EQ(time.quantile(0.99), milliseconds(90));
  EXPECT_EQ(time.quantile(1), milliseconds(100));
  EXPECT_EQ(time.mean(), milliseconds(5));
}

TEST(QueueTime, AStandingQueueCountsWhileNobodySends) {
  QueueTime time;
  time.add({}, seconds(1), milliseconds(1300));
  EXPECT_EQ(time.quantile(0.001), milliseconds(301));
  EXPECT_EQ(time.quantile(0.5), milliseconds(800));
  EXPECT_EQ(time.mean(), milliseconds(800));
}

TEST(QueueTime, LeavesOutTheWarmUp) {
  QueueTime time(seconds(1));
  time.add_empty({}, milliseconds(100));
  time.add(milliseconds(100), seconds(2), seconds(2));
  EXPECT_EQ(time.counted(), seconds(1));
  EXPECT_EQ(time.quantile(1), seconds(1));
  EXPECT_EQ(time.mean(), milliseconds(500));
}

}  // namespace
}  // namespace interneuron::emu::queue_time_test
