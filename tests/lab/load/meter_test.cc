// What a run comes to, from the fates of its messages.
#include "lab/load/meter.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace interneuron::load::meter_test {
namespace {

using namespace std::chrono_literals;

TEST(Meter, AMessageIsMissedWithoutAnyVariantByItsDeadline) {
  Meter meter(1, 100ms, {1000, 100});
  for (int i = 0; i < 4; ++i) meter.begin(0, i * 10ms);
  meter.arrived(0, 0, 0, 100ms);
  meter.arrived(0, 1, 1, 60ms);
  meter.arrived(0, 2, 0, 121ms);
  EXPECT_EQ(meter.count(), 4U);
  EXPECT_EQ(meter.missed(), 2U);
  EXPECT_EQ(meter.degraded(), 1U);
  EXPECT_EQ(meter.on_time_bytes(), 1100U);
  EXPECT_EQ(meter.age(1.0), 100ms);
}

TEST(Meter, TheFirstVariantThatArrivesCounts) {
  Meter meter(1, 100ms, {1000, 100});
  meter.begin(0, 0ms);
  meter.arrived(0, 0, 1, 50ms);
  meter.arrived(0, 0, 0, 60ms);
  EXPECT_EQ(meter.degraded(), 1U);
  EXPECT_EQ(meter.on_time_bytes(), 100U);
}

TEST(Meter, BytesOfASpanAreThoseThatArrivedWithinIt) {
  Meter meter(1, 100ms, {1000});
  for (const auto at : {10ms, 20ms, 30ms}) {
    meter.arrived(0, meter.begin(0, 0ms), 0, at);
  }
  EXPECT_EQ(meter.on_time_bytes(0, 10ms, 30ms), 2000U);
}

TEST(Meter, NobodyHasAnything) {
  EXPECT_EQ(Meter(3, 100ms, {1000}).jain({1s, 1s, 1s}), 0);
  EXPECT_EQ(Meter(3, 100ms, {1000}).age(0.99), Duration{});
}

RC_GTEST_PROP(Meter, JainsIndexIsOneForEqualsAndAnNthForOneWhoHasAll, ()) {
  const auto vehicles = *rc::gen::inRange<std::size_t>(1, 30);
  const auto each = *rc::gen::inRange(1, 20);
  Meter equal(vehicles, 100ms, {1000});
  Meter single(vehicles, 100ms, {1000});
  for (int i = 0; i < each; ++i) {
    for (std::size_t v = 0; v < vehicles; ++v) equal.arrived(v, equal.begin(v, 0ms), 0, 50ms);
    single.arrived(0, single.begin(0, 0ms), 0, 50ms);
  }
  const std::vector<Duration> spans(vehicles, 1s);
  RC_ASSERT(std::abs(equal.jain(spans) - 1) < 1e-12);
  RC_ASSERT(std::abs(single.jain(spans) - 1 / static_cast<double>(vehicles)) < 1e-12);
}

// Whoever joins later has sent less by the end, at the same rate.
TEST(Meter, JainsIndexCountsEachOverItsOwnTime) {
  Meter meter(2, 100ms, {1000});
  for (int i = 0; i < 4; ++i) meter.arrived(0, meter.begin(0, 0ms), 0, 50ms);
  meter.arrived(1, meter.begin(1, 0ms), 0, 50ms);
  EXPECT_NEAR(meter.jain({4s, 1s}), 1, 1e-12);
  EXPECT_NEAR(meter.jain({4s, 4s}), 25.0 / 34, 1e-12);
}

}  // namespace
}  // namespace interneuron::load::meter_test
