#include "core/base/water_filling.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <numeric>
#include <vector>

namespace interneuron::water_filling_test {
namespace {

using namespace std::chrono_literals;

Way way(double mbit, Duration delay, Duration deviation = 1ms) {
  return {DataRate::mbit(mbit), delay, deviation};
}

TEST(WaterFilling, AllPartsAreThereAtOneInstant) {
  const std::vector<Way> ways{way(60, 15ms), way(20, 30ms)};
  // 512 KiB: (4.19 Mbit + 60 * 15 ms + 20 * 30 ms) / 80 Mbit/s.
  const Division d = divide(ways, 512 * 1024, 75ms);
  EXPECT_NEAR(to_ms(d.time), 71.2, 0.2);
  EXPECT_NEAR(static_cast<double>(d.bytes[0]) * 8 / 60e6 + 0.015, 0.0712, 2e-4);
  EXPECT_NEAR(static_cast<double>(d.bytes[1]) * 8 / 20e6 + 0.030, 0.0712, 2e-4);
}

TEST(WaterFilling, OneWayCarriesWhatItBringsSurelyEnough) {
  const std::vector<Way> ways{way(60, 15ms), way(60, 20ms, 30ms)};
  const Division d = divide(ways, 128 * 1024, 100ms);
  EXPECT_EQ(d.bytes[0], 128U * 1024);
  EXPECT_EQ(d.bytes[1], 0U);
}

TEST(WaterFilling, DividesWhereNoRateIsSure) {
  Way a = way(8, 20ms);
  Way b = way(8, 20ms);
  a.rate_error = b.rate_error = 0.6;
  // One way needs 100 ms, give or take 50: half the time it is late; a division is there after 60
  // ms.
  const Division shares = divide(std::vector<Way>{a, b}, 80'000, 100ms);
  EXPECT_NEAR(static_cast<double>(shares.bytes[0]), 40'000, 1);
  EXPECT_GT(shares.on_time, divide(std::vector<Way>{a}, 80'000, 100ms).on_time);
}

RC_GTEST_PROP(WaterFilling, OneWayMoreNeverMakesItLessLikely, ()) {
  std::vector<Way> ways;
  const auto count = *rc::gen::inRange<std::size_t>(1, 6);
  for (std::size_t i = 0; i < count; ++i) {
    ways.push_back(way(*rc::gen::inRange(1, 2000) / 10.0,
                       Duration{*rc::gen::inRange<std::int64_t>(0, 200'000'000)},
                       Duration{*rc::gen::inRange<std::int64_t>(0, 50'000'000)}));
  }
  const auto bytes = *rc::gen::inRange<std::size_t>(1, 2'000'000);
  const Duration deadline{*rc::gen::inRange<std::int64_t>(1, 500'000'000)};
  const Division all = divide(ways, bytes, deadline);
  const std::size_t sum = std::accumulate(all.bytes.begin(), all.bytes.end(), std::size_t{0});
  RC_ASSERT(sum == bytes);
  RC_ASSERT(all.on_time >= 0 && all.on_time <= 1);
  // The soonest one alone is what a division of one way is.
  for (std::size_t i = 0; i < ways.size(); ++i) {
    const Division alone = divide({&ways[i], 1}, bytes, deadline);
    const bool is_soonest = std::ranges::all_of(ways, [&](const Way& other) {
      return divide({&other, 1}, bytes, deadline).time >= alone.time;
    });
    RC_ASSERT(!is_soonest || all.on_time >= alone.on_time - 1e-12);
  }
}

}  // namespace
}  // namespace interneuron::water_filling_test
