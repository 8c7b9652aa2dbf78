// CUBIC's window against the formulae of RFC 9438.
#include "lab/foreign/congestion.h"

#include <gtest/gtest.h>

#include <cmath>

namespace interneuron::foreign::cubic_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kRtt = 40ms;

double segments(const Cubic& cubic) { return static_cast<double>(cubic.window()) / kMss; }

// A round trip in which the whole window is delivered, segment by segment.
void round_trip(Cubic& cubic, Duration& now) {
  const auto count = static_cast<int>(segments(cubic));
  for (int i = 0; i < count; ++i) {
    now += kRtt / count;
    Delivery d{.now = now, .bytes = kMss, .peak_in_flight = cubic.window(), .smoothed_rtt = kRtt};
    cubic.delivered(d);
  }
}

Cubic grown_to(double window, Duration& now) {
  Cubic cubic;
  while (segments(cubic) < window) round_trip(cubic, now);
  return cubic;
}

TEST(Cubic, SlowStartDoublesEachRoundTrip) {
  Cubic cubic;
  Duration now{};
  EXPECT_EQ(cubic.window(), kInitialWindow);
  for (int i = 1; i <= 4; ++i) {
    round_trip(cubic, now);
    EXPECT_NEAR(segments(cubic), 10 * std::pow(2, i), 0.5) << i;
  }
}

TEST(Cubic, AWindowThatIsNotUsedDoesNotGrow) {
  Cubic cubic;
  for (int i = 0; i < 100; ++i) {
    Delivery d{.now = i * 1ms, .bytes = kMss, .peak_in_flight = std::size_t{2} * kMss};
    cubic.delivered(d);
  }
  EXPECT_EQ(cubic.window(), kInitialWindow);
}

TEST(Cubic, AfterALossTheWindowFollowsTheCurveBackToItsTopAndBeyond) {
  Duration now{};
  Cubic cubic = grown_to(1000, now);
  const double top = segments(cubic);
  cubic.congested(now);
  EXPECT_NEAR(segments(cubic), top * kCubicBeta, 1);
  const Duration begun = now;
  const double k = std::cbrt(top * (1 - kCubicBeta) / kCubicC);
  for (int i = 0; i < 350; ++i) {
    round_trip(cubic, now);
    const double t = to_seconds(now - begun);
    const double curve = kCubicC * std::pow(t - k, 3) + top;
    // The window of this round trip is on its way to that of the next one.
    EXPECT_NEAR(segments(cubic), curve, 0.02 * top) << t << " s";
  }
  EXPECT_GT(to_seconds(now - begun), k);
  EXPECT_GT(segments(cubic), top);
}

TEST(Cubic, SmallWindowsGrowAsRenos) {
  Duration now{};
  Cubic cubic = grown_to(20, now);
  cubic.congested(now);
  const double before = segments(cubic);
  for (int i = 0; i < 10; ++i) round_trip(cubic, now);
  const double alpha = 3 * (1 - kCubicBeta) / (1 + kCubicBeta);
  EXPECT_GE(segments(cubic), before + 0.8 * 10 * alpha);
}

TEST(Cubic, FastConvergenceLeavesRoomToOthers) {
  Duration now{};
  Cubic cubic = grown_to(1000, now);
  cubic.congested(now);
  const double second = segments(cubic);
  cubic.congested(now);
  const Duration begun = now;
  const double top = second * (1 + kCubicBeta) / 2;
  const double k = std::cbrt((top - second * kCubicBeta) / kCubicC);
  while (to_seconds(now - begun) < k) round_trip(cubic, now);
  EXPECT_NEAR(segments(cubic), top, 0.03 * top);
}

TEST(Cubic, ATimeoutLeavesOneSegmentAndSlowStartEndsBelowTheOldWindow) {
  Duration now{};
  Cubic cubic = grown_to(200, now);
  const double before = segments(cubic);
  cubic.timed_out(now);
  EXPECT_EQ(cubic.window(), kMss);
  for (int i = 0; i < 8; ++i) round_trip(cubic, now);
  EXPECT_NEAR(segments(cubic), kCubicBeta * before, 0.05 * before);
}

TEST(Cubic, IdleTimeDoesNotMoveTheCurve) {
  Duration now{};
  Cubic cubic = grown_to(1000, now);
  cubic.congested(now);
  round_trip(cubic, now);
  Cubic idle = cubic;
  Duration later = now + 150ms;
  idle.restarted(150ms, 200ms);
  round_trip(cubic, now);
  round_trip(idle, later);
  EXPECT_NEAR(segments(idle), segments(cubic), 1);
}

}  // namespace
}  // namespace interneuron::foreign::cubic_test
