#include "link/link_estimator.h"

#include <gtest/gtest.h>

namespace interneuron::link {
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
  EXPECT_TRUE(e.up(at(2s)));
  EXPECT_FALSE(e.up(at(2s + 1ns)));
  EXPECT_EQ(e.state(at(4s)).age, 3s);
}

TEST(LinkEstimator, LossConverges) {
  LinkEstimator e;
  for (int i = 0; i < 20'000; ++i) {
    if (i % 50 == 0) {
      e.lost(1);
    } else {
      e.acknowledged(1);
    }
  }
  EXPECT_NEAR(e.state(at(1s)).loss, 0.02, 0.004);
}

TEST(LinkEstimator, ShortTrainsSayNothing) {
  LinkEstimator e;
  e.train(1, 15, DataRate::mbit(100), std::nullopt);
  EXPECT_FALSE(e.rate());
  e.train(1, 16, DataRate::mbit(100), std::nullopt);
  EXPECT_EQ(e.rate(), DataRate::mbit(100));
}

TEST(LinkEstimator, ATrainThatWePacedIsOnlyABoundFromBelow) {
  LinkEstimator e;
  e.train(1, 32, DataRate::mbit(100), std::nullopt);
  e.train(2, 32, DataRate::mbit(50), std::nullopt);  // commits train 1
  for (std::uint64_t id = 3; id < 9; ++id) {
    e.train(id, 100, DataRate::mbit(20), DataRate::mbit(20));
  }
  EXPECT_GE(e.rate()->mbit(), 50);  // a sender that trickles does not make the link slow
}

TEST(LinkEstimator, OneCompressedTrainDoesNotMoveTheMedian) {
  LinkEstimator e;
  for (std::uint64_t id = 1; id < 8; ++id) {
    e.train(id, 300, DataRate::mbit(id == 5 ? 400 : 30), DataRate::mbit(100));
  }
  EXPECT_EQ(e.rate(), DataRate::mbit(30));
}

TEST(LinkEstimator, ProbeTimeoutFollowsTheRoundTrip) {
  LinkEstimator e;
  EXPECT_EQ(e.probe_timeout(), 200ms);
  e.round_trip(at(1s), 1ms);
  EXPECT_EQ(e.probe_timeout(), 20ms);
  e.round_trip(at(2s), 400ms);
  EXPECT_GE(e.probe_timeout(), 400ms);
}

}  // namespace
}  // namespace interneuron::link
