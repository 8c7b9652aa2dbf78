// GuardKind::kBudget at the origin: which variant the first transmission brings.
#include "core/guard/origins.h"

#include <gtest/gtest.h>

namespace interneuron::guard::budget_origin_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kUnderWay = 1ms;  // from t0 to the choice

PipelineConfig camera() {
  PipelineConfig c;
  c.stages = offload_stages();
  c.guard = GuardKind::kBudget;
  c.levels = {{8ms, 10ms, {0.14, 0.13}}, {19ms, 24ms, {0.35, 0.33}}, {44ms, 46ms, {0.40, 0.38}}};
  c.fallback.local = 0.14;
  return c;
}

// Rounds with known delays over links whose forecasts are as given.
struct Vehicle {
  explicit Vehicle(const PipelineConfig& config = camera()) : origin(config) {}

  // The mode chosen.
  bool choose() {
    Forecast whole;
    Forecast small;
    whole[0] = raw;
    small[1] = sampled;
    now = TimePoint{round * 100ms};
    const Forecast modes[] = {whole, small};
    return degraded = origin.choose_mode(now, RoundId{round}, kUnderWay, modes) == 1;
  }
  // One round more; `error`: of the forecast, `excess`: lost before the computation, `rest`: after.
  bool step(Duration error = {}, Duration excess = {}, Duration rest = {}, std::uint8_t level = 2) {
    choose();
    Spent spent{.level = level,
                .variant = degraded ? 1 : 0,
                .excess = excess,
                .computed = camera().levels[level].median};
    const Duration e2e =
        kUnderWay + (degraded ? sampled : raw) + error + excess + *spent.computed + rest;
    origin.result(now + e2e, RoundId{round}, e2e, spent);
    if (e2e > 130ms) origin.missed(now + 130ms, RoundId{round});
    ++round;
    return degraded;
  }

  BudgetOrigin origin;
  Duration raw = 66ms;
  Duration sampled = 33ms;
  TimePoint now{};
  std::uint32_t round = 0;
  bool degraded = false;
};

TEST(BudgetOrigin, BeginsWithTheSaferModeAndTurnsToTheBetterOneWhenItIsSafe) {
  Vehicle v;
  EXPECT_TRUE(v.step());
  for (int i = 0; i < 100; ++i) v.step();
  EXPECT_FALSE(v.step());
}

TEST(BudgetOrigin, WithoutAnyForecastTheSmallerMessageGoes) {
  BudgetOrigin origin(camera());
  const Forecast modes[2] = {};
  EXPECT_EQ(origin.choose_mode(TimePoint{}, RoundId{0}, kUnderWay, modes), 1U);
}

// Four images of which the links bring one, two, three or all in time.
void expect_the_best_in_time(const PipelineConfig& config) {
  BudgetOrigin origin(config);
  std::uint32_t round = 0;
  const auto chosen = [&](Duration first) {
    std::vector<Forecast> modes(4);
    Duration takes = first;
    for (std::size_t v = 0; v < modes.size(); ++v, takes = takes / 2) modes[v][v] = takes;
    const std::size_t mode =
        origin.choose_mode(TimePoint{round * 100ms}, RoundId{round}, kUnderWay, modes);
    Spent spent;
    spent.level = 0;
    spent.variant = static_cast<std::uint8_t>(mode);
    spent.computed = 10ms;
    const Duration e2e = kUnderWay + *modes[mode][mode] + 10ms;
    origin.result(TimePoint{round * 100ms} + e2e, RoundId{round}, e2e, spent);
    if (e2e > 130ms) origin.missed(TimePoint{round * 100ms + 130ms}, RoundId{round});
    ++round;
    return mode;
  };
  for (int i = 0; i < 200; ++i) chosen(60ms);
  EXPECT_EQ(chosen(60ms), 0U);
  EXPECT_EQ(chosen(160ms), 1U);
  EXPECT_EQ(chosen(320ms), 2U);
  EXPECT_EQ(chosen(640ms), 3U);
  EXPECT_EQ(chosen(60ms), 0U);
}

TEST(BudgetOrigin, OfManyVariantsTheBestThatIsInTimeGoes) {
  PipelineConfig config = camera();
  config.levels = {{10ms, 12ms, {0.40, 0.39, 0.37, 0.30}}};
  expect_the_best_in_time(config);
  config.levels.clear();  // each is taken to be worth a little less than the one before
  expect_the_best_in_time(config);
}

TEST(BudgetOrigin, DelaysThatOnlyTheSmallerMessageAbsorbsMakeItGo) {
  Vehicle v;
  for (int i = 0; i < 200; ++i) v.step();
  for (int i = 0; i < 100; ++i) v.step({}, {}, i % 4 == 0 ? 35ms : 0ms);
  EXPECT_TRUE(v.step());
  for (int i = 0; i < 600; ++i) v.step();
  EXPECT_FALSE(v.step());  // forgotten
}

// A wrong forecast is learnt, and does not condemn the mode for ever.
TEST(BudgetOrigin, AWrongForecastIsLearntAndFades) {
  Vehicle v;
  for (int i = 0; i < 100; ++i) v.step();
  ASSERT_FALSE(v.step());
  int whole = 0;
  for (int i = 0; i < 100; ++i) {
    v.choose();
    whole += v.step(v.degraded ? 0ms : 40ms) ? 0 : 1;  // raw takes 40 ms longer than forecast
  }
  EXPECT_LE(whole, 10);
  for (int i = 0; i < 1500; ++i) v.step();
  EXPECT_FALSE(v.step());
}

TEST(BudgetOrigin, WithoutLevelsTheComputationIsLearntFromResults) {
  PipelineConfig config = camera();
  config.levels.clear();
  Vehicle v(config);
  for (int i = 0; i < 100; ++i) v.step();
  EXPECT_FALSE(v.step());
  v.raw = 90ms;  // with 44 ms of computation: too late
  EXPECT_TRUE(v.step());
}

}  // namespace
}  // namespace interneuron::guard::budget_origin_test
