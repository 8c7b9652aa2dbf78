#include "core/link/estimators.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace interneuron::link::rtt_estimator_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

TEST(RttEstimator, KnowsNothingAtFirst) {
  const RttEstimator e;
  EXPECT_FALSE(e.measured());
  EXPECT_EQ(e.quantile(at(1s), 0.5), 0ns);
  EXPECT_EQ(e.minimum(at(1s)), 0ns);
}

TEST(RttEstimator, SmoothsAsRfc6298Says) {
  RttEstimator e;
  e.add(at(0s), 100ms);
  EXPECT_EQ(e.smoothed(), 100ms);
  EXPECT_EQ(e.variation(), 50ms);
  e.add(at(1s), 180ms);
  EXPECT_EQ(e.variation(), 50ms + (80ms - 50ms) / 4.0);
  EXPECT_EQ(e.smoothed(), 110ms);
  EXPECT_EQ(e.quick(), 120ms);
}

TEST(RttEstimator, QuantilesForgetAlsoWhenNothingComes) {
  RttEstimator e;
  for (int i = 0; i < 20; ++i) e.add(at(i * 100ms), i < 10 ? 80ms : 20ms);
  EXPECT_EQ(e.quantile(at(2s), 0.95), 80ms);
  EXPECT_EQ(e.quantile(at(2850ms), 0.95), 80ms);
  EXPECT_EQ(e.quantile(at(3s), 0.95), 20ms);  // the slow ones are older
  EXPECT_EQ(e.samples(at(3s)), 10U);
  EXPECT_EQ(e.quantile(at(60s), 0.95), 20ms);  // the newest stands for itself
  EXPECT_EQ(e.samples(at(60s)), 0U);
}

TEST(RttEstimator, TheMinimumLastsNineToTenSeconds) {
  RttEstimator e;
  e.add(at(500ms), 5ms);
  for (int i = 1; i < 95; ++i) e.add(at(500ms + i * 100ms), 20ms);
  EXPECT_EQ(e.minimum(at(9999ms)), 5ms);
  EXPECT_EQ(e.minimum(at(10500ms)), 20ms);
  EXPECT_EQ(e.minimum(at(100s)), 20ms);
}

TEST(RttEstimator, SurvivesAnyPeer) {
  RttEstimator e;
  e.add(at(1s), -5ms);
  EXPECT_EQ(e.quantile(at(1s), 0.5), 0ns);
  e.add(at(1s), Duration::max());
  e.add(at(1s), Duration::min());
  e.add(at(1s), 10ms);
  EXPECT_EQ(e.quantile(at(1s), 1.0), 1min);
  EXPECT_EQ(e.quantile(at(1s), 0.75), 10ms);
}

// Against a plain sort of what the window should hold, for any pace of samples.
TEST(RttEstimatorProperty, QuantilesAreExactUpTo256SamplesPerSecond) {
  EXPECT_TRUE(rc::check([] {
    const auto n = *rc::gen::inRange<std::size_t>(1, 2000);
    const auto spacing_us = *rc::gen::inRange<std::int64_t>(3907, 200'000);
    const auto spread = *rc::gen::inRange<std::int64_t>(1, 1'000'000'000);
    const auto idle_us = *rc::gen::inRange<std::int64_t>(0, 3'000'000);
    auto random = static_cast<std::uint64_t>(*rc::gen::arbitrary<std::uint32_t>()) | 1U;
    RttEstimator e;
    std::vector<std::pair<TimePoint, std::int64_t>> all;
    TimePoint now{};
    for (std::size_t i = 0; i < n; ++i) {
      random ^= random << 13, random ^= random >> 7, random ^= random << 17;
      const auto value = static_cast<std::int64_t>(random % static_cast<std::uint64_t>(spread));
      now += std::chrono::microseconds(spacing_us);
      e.add(now, Duration{value});
      all.emplace_back(now, value);
    }
    now += std::chrono::microseconds(idle_us);
    std::vector<std::int64_t> window;
    for (const auto& [when, value] : all) {
      if (when >= now - RttEstimator::kQuantileWindow) window.push_back(value);
    }
    if (window.empty()) window.push_back(all.back().second);
    std::ranges::sort(window);
    for (const double q : {0.01, 0.5, 0.9, 0.95, 1.0}) {
      const double rank = std::ceil(q * static_cast<double>(window.size()));
      const auto index = static_cast<std::size_t>(std::max(1.0, rank)) - 1;
      RC_ASSERT(e.quantile(now, q).count() == window[index]);
    }
  }));
}

TEST(RttEstimatorProperty, FasterSamplesShortenTheWindow) {
  RttEstimator e;
  for (int i = 0; i < 5000; ++i) e.add(at(i * 1ms), Duration{i});
  EXPECT_EQ(e.samples(at(5s)), RttEstimator::kCapacity);
  EXPECT_EQ(e.quantile(at(5s), 1.0).count(), 4999);
  EXPECT_EQ(e.quantile(at(4999ms), 0.5).count(), 4999 - 256);
}

}  // namespace
}  // namespace interneuron::link::rtt_estimator_test
