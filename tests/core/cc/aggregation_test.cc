#include "core/cc/aggregation.h"

#include <gtest/gtest.h>

namespace interneuron::cc::aggregation_test {
namespace {

using namespace std::chrono_literals;

constexpr DataRate kRate = DataRate::mbit(8);
constexpr std::size_t kBytesPerMs = 1000;

// For a second what left within `every` arrives at once.
Duration mean_of(Duration every) {
  Aggregation aggregation;
  for (TimePoint now{1h}; now < TimePoint{1h + 1s}; now += every) {
    aggregation.arrived(now, kBytesPerMs * static_cast<std::size_t>(every / 1ms), kRate);
  }
  return aggregation.mean();
}

TEST(Aggregation, IsWhatOneGrantBrings) {
  EXPECT_LE(mean_of(5ms), 5ms);
  EXPECT_NEAR(to_ms(mean_of(20ms)), 20, 2);
  EXPECT_NEAR(to_ms(mean_of(40ms)), 40, 4);
}

TEST(Aggregation, AStallIsNone) {
  Aggregation aggregation;
  TimePoint now{1h};
  for (int i = 0; i < 200; ++i, now += 5ms) aggregation.arrived(now, 5 * kBytesPerMs, kRate);
  now += 50ms;
  aggregation.arrived(now, 55 * kBytesPerMs, kRate);
  for (int i = 0; i < 40; ++i, now += 5ms) aggregation.arrived(now, 5 * kBytesPerMs, kRate);
  EXPECT_LE(aggregation.mean(), 12ms);
}

TEST(Aggregation, IsNoneWhileTheRateIsNotKnown) {
  Aggregation aggregation;
  aggregation.arrived(TimePoint{1h}, 100'000, DataRate{});
  EXPECT_EQ(aggregation.mean(), 0s);
}

}  // namespace
}  // namespace interneuron::cc::aggregation_test
