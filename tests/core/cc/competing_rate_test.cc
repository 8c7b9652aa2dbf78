#include "core/cc/competing_rate.h"

#include <gtest/gtest.h>

namespace interneuron::cc::competing_rate_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kRoundTrip = 200ms;
constexpr DataRate kPipe = DataRate::mbit(30);

struct Flow {
  CompetingRate rate;
  TimePoint now{1h};
  DataRate wanted;

  Flow(DataRate begins_with, DataRate asks_for) : wanted(asks_for) { rate.begin(now, begins_with); }
  DataRate after(Duration time) {
    DataRate at{};
    for (const TimePoint end = now + time; now < end;) {
      now += 100ms;
      at = rate.at(now, kRoundTrip, wanted, kPipe);
    }
    return at;
  }
  void loses(std::uint32_t packets = 1) { rate.lost(now, packets, kRoundTrip); }
};

TEST(CompetingRate, ALossLeavesSevenTenthsAndThreeSecondsBringThemBack) {
  Flow flow(DataRate::mbit(10), kPipe);
  flow.after(1s);
  flow.loses();
  // Half of the pipe is what it takes in any case.
  EXPECT_EQ(flow.after(100ms), kPipe.scaled(0.5));
  Flow large(DataRate::mbit(24), kPipe);
  large.after(1s);
  large.loses();
  EXPECT_NEAR(to_seconds(1s) * double(large.after(100ms).bits_per_second), 16.8e6, 0.5e6);
  // K of RFC 9438: the cube root of 336 packets x 0.3 / 0.4.
  EXPECT_NEAR(double(large.after(6s).bits_per_second), 24e6, 0.5e6);
  EXPECT_GT(large.after(3s), DataRate::mbit(24).scaled(1.01));
}

TEST(CompetingRate, LossesOfOneRoundTripAreOne) {
  Flow flow(DataRate::mbit(24), kPipe);
  flow.after(1s);
  flow.loses();
  const DataRate once = flow.after(100ms);
  flow.loses();
  EXPECT_GE(flow.after(100ms), once);
  flow.after(200ms);
  flow.loses();
  EXPECT_LT(flow.after(100ms), once);
}

TEST(CompetingRate, WhatIsNotAskedForIsNotTaken) {
  Flow flow(DataRate::mbit(4), DataRate::mbit(4));
  EXPECT_EQ(flow.after(60s), DataRate::mbit(8));
}

TEST(CompetingRate, WhoAsksForLittleKeepsItThroughFewLossesButNotThroughMany) {
  Flow flow(DataRate::mbit(8), DataRate::mbit(4));
  for (int i = 0; i < 20; ++i) {
    flow.after(1s);
    flow.loses();
  }
  EXPECT_GE(flow.after(100ms), DataRate::mbit(4));
  // 4 Mbit/s are 350 packets a second: 3 % of these.
  for (int i = 0; i < 20; ++i) {
    flow.after(1s);
    flow.loses(11);
  }
  EXPECT_LT(flow.after(100ms), DataRate::mbit(2));
}

}  // namespace
}  // namespace interneuron::cc::competing_rate_test
