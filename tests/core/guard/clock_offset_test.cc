#include "core/guard/clock_offset.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace interneuron::guard::clock_offset_test {
namespace {

using namespace std::chrono_literals;

// Two hosts with a true offset: own = world + alpha, peer = world.
struct Pair {
  explicit Pair(std::int64_t true_alpha = 0) : alpha(true_alpha) {}
  std::int64_t alpha;
  ClockOffset clock;

  TimePoint own(Duration world) const { return TimePoint{Duration{world.count() + alpha}}; }
  static PeerTime peer(Duration world) { return PeerTime{world}; }

  // We send at `sent`, it arrives after `there`, is held for `held`, and comes back after `back`.
  ClockOffset::Update exchange(Duration sent, Duration there, Duration held, Duration back) {
    const Duration u = sent + there + held;
    return clock.add(own(u + back), peer(u), own(sent), held);
  }
};

TEST(ClockOffset, SymmetricExchangeGivesTheOffsetExactly) {
  Pair p(1'000'000'000);
  EXPECT_EQ(p.exchange(1s, 10ms, 3ms, 10ms), ClockOffset::Update::kAccepted);
  const auto view = p.clock.view(p.own(1100ms));
  ASSERT_TRUE(view);
  EXPECT_EQ(view->alpha, p.alpha);
  EXPECT_EQ(view->rtt_min, 20ms);
}

TEST(ClockOffset, TheSmallestRoundTripOfTheWindowWinsTiesByAge) {
  Pair p(5);
  p.exchange(1s, 10ms, 0ms, 30ms);  // error of the midpoint: +10 ms
  p.exchange(2s, 4ms, 0ms, 6ms);    // +1 ms
  p.exchange(3s, 6ms, 0ms, 4ms);    // as short, newer: -1 ms
  EXPECT_EQ(p.clock.view(p.own(4s))->alpha, 5 - 1'000'000);
}

TEST(ClockOffset, ForgetsAfterTheWindow) {
  Pair p;
  p.exchange(1s, 5ms, 0ms, 5ms);
  EXPECT_TRUE(p.clock.view(p.own(11s)));
  EXPECT_FALSE(p.clock.view(p.own(11s + 11ms)));
  EXPECT_FALSE(p.clock.hi_min(p.own(12s)));
}

TEST(ClockOffset, RejectsImpossibleRoundTrips) {
  Pair p;
  EXPECT_EQ(p.clock.add(TimePoint{5s}, PeerTime{1s}, TimePoint{6s}, 0ns),
            ClockOffset::Update::kRejected);  // sent after it was received
  EXPECT_EQ(p.clock.add(TimePoint{5s}, PeerTime{1s}, TimePoint{4s}, 2s),
            ClockOffset::Update::kRejected);  // held for longer than it was away
  EXPECT_EQ(p.clock.add(TimePoint{500s}, PeerTime{1s}, TimePoint{4s}, 0ns),
            ClockOffset::Update::kRejected);  // absurd
  EXPECT_FALSE(p.clock.view(TimePoint{5s}));
}

TEST(ClockOffset, AStepOfThePeersClockDropsWhatWasLearnt) {
  Pair p(100);
  p.exchange(1s, 5ms, 0ms, 5ms);
  p.alpha += 50'000'000;  // the peer's clock went back by 50 ms
  EXPECT_EQ(p.exchange(2s, 5ms, 0ms, 5ms), ClockOffset::Update::kStepped);
  EXPECT_EQ(p.clock.view(p.own(2100ms))->alpha, p.alpha);
}

TEST(ClockOffset, DriftWithinItsBoundIsNoStep) {
  Pair p;
  for (int i = 0; i < 100; ++i) {
    p.alpha = i * 10'000;  // 100 ppm at 100 ms
    EXPECT_EQ(p.exchange(i * 100ms, 5ms, 0ms, 5ms), ClockOffset::Update::kAccepted);
  }
}

RC_GTEST_PROP(ClockOffset, AlwaysBoundsTheTruthAndIsOffByHalfTheRoundTripAtMost, ()) {
  Pair p(*rc::gen::inRange<std::int64_t>(-86'400'000'000'000, 86'400'000'000'000));
  const auto count = *rc::gen::inRange(1, 30);
  Duration t{};
  for (int i = 0; i < count; ++i) {
    t += Duration{*rc::gen::inRange(1, 500'000'000)};
    p.exchange(t, Duration{*rc::gen::inRange(0, 400'000'000)},
               Duration{*rc::gen::inRange(0, 50'000'000)},
               Duration{*rc::gen::inRange(0, 400'000'000)});
  }
  const TimePoint now = p.own(t + 1s);
  const auto view = p.clock.view(now);
  RC_ASSERT(view.has_value());
  RC_ASSERT(std::abs(view->alpha - p.alpha) <= view->rtt_min.count() / 2 + 1);
  RC_ASSERT(p.clock.hi_min(now)->count() >= p.alpha);
}

RC_GTEST_PROP(ClockOffset, AnyBytesOfThePeerAreHarmless, ()) {
  ClockOffset clock;
  TimePoint r{};
  for (int i = 0; i < 20; ++i) {
    r += Duration{*rc::gen::inRange(0, 1'000'000)};
    clock.add(r, PeerTime{Duration{*rc::gen::arbitrary<std::int64_t>()}},
              TimePoint{Duration{*rc::gen::arbitrary<std::int64_t>()}},
              Duration{*rc::gen::arbitrary<std::int64_t>()});
    clock.view(r);
    clock.hi_min(r);
  }
}

}  // namespace
}  // namespace interneuron::guard::clock_offset_test
