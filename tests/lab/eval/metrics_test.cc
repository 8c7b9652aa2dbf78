#include "lab/eval/metrics.h"

#include <gtest/gtest.h>

#include "core/base/statistics.h"

namespace interneuron::eval::metrics_test {
namespace {

using namespace std::chrono_literals;

TEST(Percentile, IsByNearestRank) {
  EXPECT_EQ(percentile({}, 0.5), 0);
  EXPECT_EQ(percentile({5}, 0.99), 5);
  EXPECT_EQ(percentile({4, 1, 3, 2}, 0.5), 2);
  EXPECT_EQ(percentile({4, 1, 3, 2}, 0.95), 4);
}

// The intervals of the paper's 8 and 152 of 300: 1.4-5.2 % and 45-56 %; of 0 of 300: 0-1.26 %.
TEST(Wilson, HasTheIntervalsOfThePapersFigures) {
  EXPECT_NEAR(wilson95(8, 300)[0], 0.0136, 1e-4);
  EXPECT_NEAR(wilson95(8, 300)[1], 0.0517, 1e-4);
  EXPECT_NEAR(wilson95(152, 300)[0], 0.450, 1e-3);
  EXPECT_NEAR(wilson95(152, 300)[1], 0.563, 1e-3);
  EXPECT_EQ(wilson95(0, 300)[0], 0);
  EXPECT_NEAR(wilson95(0, 300)[1], 0.0126, 1e-4);
  EXPECT_EQ(wilson95(300, 300)[1], 1);
  EXPECT_EQ(wilson95(0, 0), (std::array<double, 2>{0, 1}));
}

Round round_of(bool on_time, Duration e2e, Shown shown) {
  Round round;
  round.on_time = on_time;
  round.e2e = e2e;
  round.shown = shown;
  return round;
}

TEST(Figures, PoolsRunsAndNeverCountsMissesAcrossThem) {
  const Profile profile = default_profile();
  const Shown top{Shown::Kind::kRemote, 2, 0, 0};
  const Shown local{Shown::Kind::kLocal, 0, 0, 0};
  eval::Run a;
  a.rounds = {round_of(true, 100ms, top), round_of(false, 130ms, local),
              round_of(false, 130ms, local)};
  a.bytes_up = {600, 0};
  a.bytes_down = {30, 60};
  eval::Run b;
  b.rounds = {round_of(false, 130ms, {}), round_of(true, 110ms, top)};
  b.bytes_up = {400, 0};
  b.bytes_down = {20, 40};
  const std::vector<eval::Run> runs{a, b};
  const Figures f = figures(runs, profile);
  EXPECT_EQ(f.rounds, 5U);
  EXPECT_EQ(f.timeouts, 3U);
  EXPECT_EQ(f.timeouts_ci95, wilson95(3, 5));
  EXPECT_EQ(f.consecutive, 1U);
  EXPECT_DOUBLE_EQ(f.e2e_mean_ms, 105);
  EXPECT_DOUBLE_EQ(f.e2e_p50_ms, 100);
  EXPECT_DOUBLE_EQ(f.e2e_p99_ms, 110);
  EXPECT_DOUBLE_EQ(f.quality_on_time, 0.396);
  EXPECT_DOUBLE_EQ(f.quality, (2 * 0.396 + 2 * 0.136) / 5);
  EXPECT_EQ(f.bytes_per_round, (std::vector<double>{210, 20}));
}

TEST(Figures, OfNothingAreNothing) {
  const Figures f = figures({}, default_profile());
  EXPECT_EQ(f.rounds, 0U);
  EXPECT_EQ(f.quality, 0);
  EXPECT_EQ(f.e2e_p99_ms, 0);
}

}  // namespace
}  // namespace interneuron::eval::metrics_test
