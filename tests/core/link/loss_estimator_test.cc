#include "core/link/estimators.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <random>

namespace interneuron::link::loss_estimator_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

// Losses in runs of `burst` on average (Gilbert), `rate` packets per second; returns the next time.
TimePoint feed(LossEstimator& e, std::mt19937_64& random, TimePoint from, int packets, double loss,
               double burst, double rate) {
  std::uniform_real_distribution<double> u;
  bool bad = false;
  TimePoint now = from;
  for (int i = 0; i < packets; ++i) {
    const double into = burst > 1 ? loss / (1 - loss) / burst : loss;
    bad = burst > 1 ? u(random) < (bad ? 1 - 1 / burst : into) : u(random) < loss;
    now += Duration{static_cast<std::int64_t>(1e9 / rate)};
    if (bad) {
      e.lost(now, 1);
    } else {
      e.arrived(now, 1);
    }
  }
  return now;
}

TEST(LossEstimator, BeginsWithThePlainMean) {
  LossEstimator e;
  EXPECT_EQ(e.loss(), 0);
  EXPECT_EQ(e.burst(), 0);
  e.arrived(at(1s), 3);
  e.lost(at(1s), 1);
  EXPECT_DOUBLE_EQ(e.loss(), 0.25);
  EXPECT_DOUBLE_EQ(e.packets(), 4);
}

TEST(LossEstimator, RunsAreCountedAcrossCalls) {
  LossEstimator e;
  e.lost(at(1s), 1);
  e.lost(at(1s), 2);
  EXPECT_EQ(e.burst(), 3);
  e.arrived(at(1s), 10);
  e.lost(at(1s), 1);
  e.arrived(at(1s), 1);
  EXPECT_DOUBLE_EQ(e.burst(), 2);
}

// The criterion, for many seeds: at most one in a hundred may miss it, since 0.5 points are
// three standard errors at 5 %.
TEST(LossEstimator, IsWithinHalfAPointAfter20000Packets) {
  for (const double nominal : {0.01, 0.05}) {
    int missed = 0;
    for (unsigned seed = 1; seed <= 200; ++seed) {
      std::mt19937_64 random(seed);
      LossEstimator e;
      feed(e, random, at(0s), 20'000, nominal, 1, 1'000);
      if (std::abs(e.loss() - nominal) > 0.005) ++missed;
      EXPECT_NEAR(e.loss(), nominal, 0.01) << nominal << " seed " << seed;
    }
    EXPECT_LE(missed, 2) << nominal;
  }
}

TEST(LossEstimator, FollowsAStepWithin2000Packets) {
  for (unsigned seed = 1; seed <= 50; ++seed) {
    std::mt19937_64 random(seed);
    LossEstimator e;
    TimePoint now = feed(e, random, at(0s), 20'000, 0.001, 1, 1'000);
    now = feed(e, random, now, 2'000, 0.05, 1, 1'000);
    EXPECT_NEAR(e.loss(), 0.05, 0.025) << seed;
    feed(e, random, now, 4'000, 0.001, 1, 1'000);
    EXPECT_LT(e.loss(), 0.012) << seed;
  }
}

TEST(LossEstimator, TellsBurstsFromSingleLosses) {
  std::mt19937_64 random(7);
  LossEstimator single;
  LossEstimator bursty;
  feed(single, random, at(0s), 20'000, 0.02, 1, 1'000);
  feed(bursty, random, at(0s), 20'000, 0.02, 8, 1'000);
  EXPECT_LT(single.burst(), 1.3);
  EXPECT_NEAR(bursty.burst(), 8, 5);
  EXPECT_NEAR(bursty.loss(), 0.02, 0.01);
}

TEST(LossEstimator, ForgetsWithTime) {
  // Wherever the clock stands.
  for (const Duration start : {Duration(0s), Duration(1h), Duration(-1h)}) {
    LossEstimator e;
    for (int i = 0; i < 100; ++i) {
      e.lost(at(start + i * 1s), 1);
      e.arrived(at(start + i * 1s), 9);
    }
    EXPECT_NEAR(e.loss(), 0.1, 0.03);
    EXPECT_LT(e.packets(), 620);      // 10 per second, 60 s
    e.arrived(at(start + 400s), 10);  // five minutes later
    EXPECT_LT(e.loss(), 0.05);
  }
}

TEST(LossEstimatorProperty, IsAShareWhateverComes) {
  EXPECT_TRUE(rc::check([](const std::vector<std::pair<bool, std::uint16_t>>& outcomes) {
    LossEstimator e;
    TimePoint now{};
    for (const auto& [lost, n] : outcomes) {
      now += std::chrono::milliseconds(n);
      if (lost) {
        e.lost(now, n);
      } else {
        e.arrived(now, n);
      }
      RC_ASSERT(e.loss() >= 0 && e.loss() <= 1);
      RC_ASSERT(e.burst() >= 0);
      RC_ASSERT(e.packets() <= LossEstimator::kMemory);
    }
  }));
}

}  // namespace
}  // namespace interneuron::link::loss_estimator_test
