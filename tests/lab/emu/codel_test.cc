#include "lab/emu/queue.h"

#include <gtest/gtest.h>

#include <cmath>

namespace interneuron::emu::codel_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::size_t kDeep = 100'000;

// Asks once a millisecond about packets that have waited for `sojourn`; gives the signals.
std::vector<Duration> signals(CoDel& codel, Duration from, Duration to, Duration sojourn,
                              std::size_t behind = kDeep) {
  std::vector<Duration> out;
  for (Duration t = from; t < to; t += milliseconds(1)) {
    if (codel.signals(t, sojourn, behind)) out.push_back(t);
  }
  return out;
}

TEST(CoDel, LetsAlonePacketsThatWaitLessThanTheTarget) {
  CoDel codel;
  EXPECT_TRUE(signals(codel, {}, seconds(10), milliseconds(5) - Duration{1}).empty());
}

TEST(CoDel, LetsAloneAQueueOfLessThanOnePacket) {
  CoDel codel;
  EXPECT_TRUE(signals(codel, {}, seconds(10), seconds(1), 1500).empty());
  EXPECT_FALSE(signals(codel, seconds(10), seconds(20), seconds(1), 1501).empty());
}

TEST(CoDel, SignalsFirstWhenTheQueueHasStoodForAnInterval) {
  CoDel codel;
  EXPECT_TRUE(signals(codel, {}, milliseconds(100), milliseconds(5)).empty());
  EXPECT_TRUE(codel.signals(milliseconds(100), milliseconds(5), kDeep));
}

TEST(CoDel, OnePacketThatWaitedLessBeginsTheIntervalAnew) {
  CoDel codel;
  EXPECT_TRUE(signals(codel, {}, milliseconds(99), milliseconds(50)).empty());
  EXPECT_FALSE(codel.signals(milliseconds(99), milliseconds(4), kDeep));
  EXPECT_TRUE(signals(codel, milliseconds(100), milliseconds(200), milliseconds(50)).empty());
  EXPECT_TRUE(codel.signals(milliseconds(200), milliseconds(50), kDeep));
}

// RFC 8289, section 3.3: the n-th signal is followed by a pause of interval / sqrt(n).
TEST(CoDel, SignalsFollowTheInverseSquareRoot) {
  CoDel codel;
  const std::vector<Duration> at = signals(codel, {}, seconds(5), milliseconds(50));
  ASSERT_GT(at.size(), 20U);
  double expected_ms = 100;
  for (std::size_t n = 0; n < at.size(); ++n) {
    EXPECT_NEAR(to_ms(at[n]), expected_ms, 1.001) << n;
    expected_ms += 100 / std::sqrt(static_cast<double>(n + 1));
  }
}

TEST(CoDel, ComesBackWithTheRateOfTheLastCycle) {
  CoDel codel;
  const auto first = signals(codel, {}, seconds(2), milliseconds(50));
  EXPECT_FALSE(codel.signals(seconds(2), milliseconds(1), kDeep));
  const auto second = signals(codel, seconds(2), seconds(3), milliseconds(50));
  ASSERT_GT(second.size(), 5U);
  EXPECT_EQ(second[0], seconds(2) + milliseconds(100));
  const double pause_ms = 100 / std::sqrt(static_cast<double>(first.size() - 1));
  EXPECT_NEAR(to_ms(second[1] - second[0]), pause_ms, 1.001);
}

TEST(CoDel, ForgetsTheRateOfALongPastCycle) {
  CoDel codel;
  signals(codel, {}, seconds(2), milliseconds(50));
  codel.emptied();
  const auto later = signals(codel, seconds(10), seconds(11), milliseconds(50));
  ASSERT_GT(later.size(), 1U);
  EXPECT_EQ(later[1] - later[0], milliseconds(100));
}

}  // namespace
}  // namespace interneuron::emu::codel_test
