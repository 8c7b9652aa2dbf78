#include "core/dispatch/routes.h"

#include <gtest/gtest.h>

#include "interneuron/message.h"
#include "interneuron/sizes.h"

namespace interneuron::arrival_forecast_test {
namespace {

using dispatch::arrival_forecast;
using dispatch::cannot_arrive;

using namespace std::chrono_literals;

LinkState link_of(double mbit, Duration rtt) {
  return LinkState{.up = true, .rtt_min = rtt, .rate = DataRate::mbit(mbit)};
}

TEST(ArrivalForecast, IsHalfARoundTripTheQueuesAndTheBytesAtTheRate) {
  LinkState link = link_of(8, 40ms);
  const Duration own = link.rate.transmit_time(wire_size(10'000));
  EXPECT_EQ(arrival_forecast(link, 0, 10'000), 20ms + own);
  link.queue_up = 7ms;
  EXPECT_EQ(arrival_forecast(link, 0, 10'000), 27ms + own);
  EXPECT_NEAR(to_ms(*arrival_forecast(link, 10'000, 10'000)), to_ms(27ms + 2 * own), 0.01);
}

TEST(ArrivalForecast, WhatWasNotMeasuredSpeaksAgainstNothing) {
  EXPECT_EQ(arrival_forecast(link_of(0, 40ms), 0, 100), 20ms);
  EXPECT_EQ(arrival_forecast(link_of(8, 0ms), 0, 100), std::nullopt);
  EXPECT_FALSE(cannot_arrive(link_of(8, 0ms), std::nullopt, 1ns));
}

TEST(ArrivalForecast, AlmostNoRateIsFarBeyondAnyDeadline) {
  LinkState link = link_of(0, 40ms);
  link.rate = DataRate{1};
  const auto expected = arrival_forecast(link, kMaxMessageBytes, kMaxMessageBytes);
  EXPECT_TRUE(cannot_arrive(link, expected, 1h));
}

TEST(ArrivalForecast, AMissByLessThanTheDelayVariesIsTried) {
  LinkState link = link_of(8, 40ms);
  link.jitter = 3ms;
  EXPECT_FALSE(cannot_arrive(link, 103ms, 100ms));
  EXPECT_TRUE(cannot_arrive(link, 103ms + 1ns, 100ms));
}

}  // namespace
}  // namespace interneuron::arrival_forecast_test
