#include "core/base/rate_limit.h"

#include <gtest/gtest.h>

namespace interneuron::rate_limit_test {
namespace {

using namespace std::chrono_literals;

TEST(RateLimit, LetsABurstComeAndThenTheRate) {
  RateLimit limit(1000, 10ms);
  int taken = 0;
  for (int i = 0; i < 100; ++i) taken += limit.take(TimePoint{5s}) ? 1 : 0;
  EXPECT_EQ(taken, 11);
  taken = 0;
  for (Duration t = 5s; t < 6s; t += 100us) taken += limit.take(TimePoint{t}) ? 1 : 0;
  EXPECT_EQ(taken, 999);
  // After a pause no more than a burst comes at once.
  taken = 0;
  for (int i = 0; i < 100; ++i) taken += limit.take(TimePoint{1h}) ? 1 : 0;
  EXPECT_EQ(taken, 11);
}

TEST(RateLimit, WhatKeepsTheRateIsNeverRefused) {
  RateLimit limit(50'000, 0ms);
  for (Duration t = 0s; t < 1s; t += 20us) ASSERT_TRUE(limit.take(TimePoint{t}));
}

}  // namespace
}  // namespace interneuron::rate_limit_test
