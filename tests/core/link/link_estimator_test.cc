#include "core/link/link_estimator.h"

#include <gtest/gtest.h>

namespace interneuron::link::link_estimator_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

TEST(LinkEstimator, KnowsNothingBeforeTheFirstEvidence) {
  const LinkState s = LinkEstimator{}.state(at(1s));
  EXPECT_FALSE(s.up);
  EXPECT_EQ(s.rtt_p50, 0ns);
  EXPECT_EQ(s.rate, DataRate{});
  EXPECT_EQ(s.age, Duration::max());
}

TEST(LinkEstimator, QuantilesAreOfTheLastTwoSecondsMinimumOfTen) {
  LinkEstimator e;
  e.round_trip(at(0s), 5ms);
  for (int i = 0; i < 40; ++i) e.round_trip(at(3s + i * 50ms), i < 37 ? 20ms : 90ms);
  const LinkState s = e.state(at(5s));
  EXPECT_EQ(s.rtt_p50, 20ms);
  EXPECT_EQ(s.rtt_p95, 90ms);
  EXPECT_EQ(s.rtt_min, 5ms);
  e.round_trip(at(11s), 30ms);
  EXPECT_EQ(e.state(at(11s)).rtt_min, 20ms);
}

TEST(LinkEstimator, IsUpWhileSomethingIsHeard) {
  LinkEstimator e;
  e.heard(at(1s));
  EXPECT_TRUE(e.up());
  EXPECT_EQ(e.state(at(2s)).age, 1s);
  EXPECT_EQ(e.state(at(2s)).confidence, 1.0);
  while (e.next_timeout() && *e.next_timeout() <= at(3s)) e.handle_timeout(*e.next_timeout());
  EXPECT_FALSE(e.up());
  EXPECT_EQ(e.path(), PathState::kPulled);
  EXPECT_LT(e.state(at(3s)).confidence, 1.0);
  e.heard(at(3s));
  EXPECT_TRUE(e.up());
}

TEST(LinkEstimator, TheOperatorMayForbidIt) {
  LinkEstimator e;
  e.set_traits({.role = LinkRole::kNever});
  e.heard(at(1s));
  EXPECT_FALSE(e.state(at(1s)).up);
  EXPECT_EQ(e.path(), PathState::kOk);
}

TEST(LinkEstimator, CollectsWhatTheMachinesSay) {
  LinkEstimator e;
  e.set_traits({.rate_cap = DataRate::mbit(8)});
  e.heard(at(1s));
  e.round_trip(at(1s), 40ms);
  e.one_way_delays(at(1s), -1h, 1h);
  e.one_way_delays(at(1100ms), -1h + 8ms, 1h + 4ms);
  e.arrived(at(1s), 98);
  e.lost(at(1s), 2);
  e.train(at(1s), {1, 100, 100, 99 * 1428, DataRate::mbit(10), std::nullopt, {}});
  e.peer_sees(DataRate::mbit(3), 0.5);
  const LinkState s = e.state(at(1100ms));
  EXPECT_EQ(s.rtt_p50, 40ms);
  EXPECT_EQ(s.jitter, 20ms);
  EXPECT_EQ(s.queue_up, 2ms);
  EXPECT_EQ(s.queue_down, 1ms);
  EXPECT_NEAR(s.loss, 0.02, 1e-12);
  EXPECT_EQ(s.loss_burst, 2);
  EXPECT_EQ(s.rate, DataRate::mbit(8));
  EXPECT_EQ(s.rate_age, 100ms);
  EXPECT_EQ(s.rate_down, DataRate::mbit(3));
  EXPECT_EQ(s.loss_down, 0.5);
  EXPECT_EQ(e.one_way(), 20ms);
  e.clock_stepped();
  EXPECT_EQ(e.state(at(1100ms)).queue_up, 0ms);
}

TEST(LinkEstimator, ProbeTimeoutFollowsTheRoundTrip) {
  LinkEstimator e;
  EXPECT_EQ(e.probe_timeout(at(1s)), 200ms);
  e.round_trip(at(1s), 1ms);
  EXPECT_EQ(e.probe_timeout(at(1s)), 20ms);
  e.round_trip(at(2s), 400ms);
  EXPECT_GE(e.probe_timeout(at(2s)), 400ms);
}

}  // namespace
}  // namespace interneuron::link::link_estimator_test
