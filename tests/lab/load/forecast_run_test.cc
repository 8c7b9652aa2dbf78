// Runs that judge predictions, short ones.
#include "lab/load/forecast.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support.h"

namespace interneuron::load::forecast_run_test {
namespace {

using namespace std::chrono_literals;

std::ptrdiff_t refused(const std::vector<Forecast>& all) {
  return std::ranges::count(all, true, &Forecast::refused);
}

TEST(Forecasts, EveryNameHasRuns) {
  for (const std::string& name : forecast_names()) {
    EXPECT_FALSE(forecast_scenarios(name, 1).empty()) << name;
  }
  EXPECT_TRUE(forecast_scenarios("nothing", 1).empty());
}

TEST(Forecasts, BelowCapacityAllAreOnTimeAndLikely) {
  const auto all = forecasts(first("rate", 0.5, 3s));
  EXPECT_GT(all.size(), 50U);
  EXPECT_EQ(refused(all), 0);
  EXPECT_TRUE(std::ranges::all_of(all, &Forecast::on_time));
  EXPECT_TRUE(std::ranges::all_of(all, [](const Forecast& f) { return f.predicted > 0.8; }));
}

TEST(Forecasts, RefusedMessagesAreSentNevertheless) {
  const auto all = forecasts(first("size", 3, 4s));
  EXPECT_GT(refused(all), 2);
  EXPECT_LT(refused(all), 40);
  EXPECT_TRUE(std::ranges::all_of(
      all, [](const Forecast& f) { return f.predicted > 0 && f.predicted < 1; }));
}

TEST(Forecasts, TheSameScenarioGivesTheSame) {
  const auto a = forecasts(first("4g", 0, 5s));
  const auto b = forecasts(first("4g", 0, 5s));
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].predicted, b[i].predicted);
    EXPECT_EQ(a[i].on_time, b[i].on_time);
  }
}

}  // namespace
}  // namespace interneuron::load::forecast_run_test
