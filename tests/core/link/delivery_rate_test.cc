#include "core/link/delivery_rate.h"

#include <gtest/gtest.h>

#include <deque>

namespace interneuron::link::delivery_rate_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

TEST(DeliveryRate, IsTheSlowerOfSendingAndAcknowledging) {
  // 1250 bytes every ms: 10 Mbit/s sent; acknowledged every 2 ms, 50 ms later: 5 Mbit/s.
  DeliveryRate rate;
  std::deque<DeliveryStamp> flight;
  std::optional<DeliveryRate::Sample> last;
  for (int ms = 0; ms < 400; ++ms) {
    if (ms >= 50 && ms % 2 == 0) {
      rate.acknowledged(at(ms * 1ms), flight.front());
      flight.pop_front();
      if (auto sample = rate.sample(50ms)) last = sample;
    }
    flight.push_back(rate.sent(at(ms * 1ms), 1250, flight.empty(), true));
  }
  ASSERT_TRUE(last);
  EXPECT_NEAR(last->rate.mbit(), 5, 0.3);
  EXPECT_FALSE(last->app_limited);
}

TEST(DeliveryRate, WhatTheApplicationHeldBackSaysSo) {
  DeliveryRate rate;
  const DeliveryStamp a = rate.sent(at(0s), 1250, true, false);
  const DeliveryStamp b = rate.sent(at(1ms), 1250, false, false);
  rate.acknowledged(at(50ms), a);
  rate.acknowledged(at(51ms), b);
  const auto sample = rate.sample(10ms);
  ASSERT_TRUE(sample);
  EXPECT_TRUE(sample->app_limited);
  EXPECT_NEAR(sample->rate.mbit(), 2500 * 8e-6 / 0.051, 0.01);
  EXPECT_FALSE(rate.sample(10ms));  // nothing new
}

TEST(DeliveryRate, ABurstOfAcknowledgementsIsNoRate) {
  DeliveryRate rate;
  const DeliveryStamp a = rate.sent(at(0s), 1250, true, true);
  rate.acknowledged(at(30ms), a);
  EXPECT_FALSE(rate.sample(50ms));
}

}  // namespace
}  // namespace interneuron::link::delivery_rate_test
