// Fitting the laws of send()'s predictions to runs.
#include "lab/load/on_time_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/messages/on_time_weights.h"
#include "support.h"

namespace interneuron::load::on_time_fit_test {
namespace {

using namespace std::chrono_literals;

// So many messages with this time to spare, one after the other, of which this share is on time.
void append(std::vector<ForecastStep>& steps, Duration spare, double share, int messages) {
  double owed = 0;
  for (int i = 0; i < messages; ++i) {
    ForecastStep step;
    step.is_message = true;
    step.judged = true;
    step.outlook.refused = false;
    step.outlook.at = TimePoint{steps.size() * 50ms};
    step.outlook.deadline = 100ms;
    step.outlook.expected = 100ms - spare;
    step.outlook.least = 100ms - spare;
    owed += share;
    step.forecast.on_time = owed >= 1;
    if (owed >= 1) owed -= 1;
    steps.push_back(step);
  }
}

double mean(const std::vector<Forecast>& forecasts, std::size_t from, std::size_t to) {
  double sum = 0;
  for (std::size_t i = from; i < to; ++i) sum += forecasts[i].predicted;
  return sum / static_cast<double>(to - from);
}

// So the laws are fitted to what the endpoint really weighs. A few messages differ a little, and
// those after them by what the bias has learnt of it: send() looks at the paths again.
TEST(OnTimeFit, WhatSendSaidIsSaidAgainFromTheSteps) {
  for (const ForecastScenario& s : {first("rate", 1.5, 3s), first("vehicles", 2, 3s),
                                    first("4g", 0, 10s), first("generated-cellular", 0, 10s)}) {
    const ForecastRun run = forecast_run(s);
    for (const auto* steps : {&run.accepted, &run.nevertheless}) {
      std::vector<double> said;
      for (const ForecastStep& step : *steps) {
        if (step.judged) said.push_back(step.forecast.predicted);
      }
      const std::vector<Forecast> again = replayed(*steps, kOnTimeLaws);
      ASSERT_EQ(again.size(), said.size());
      std::size_t same = 0;
      for (std::size_t i = 0; i < said.size(); ++i) {
        if (std::abs(again[i].predicted - said[i]) < 1e-9) ++same;
        EXPECT_NEAR(again[i].predicted, said[i], 0.05);
      }
      EXPECT_GE(static_cast<double>(same), 0.9 * static_cast<double>(said.size()));
    }
  }
}

TEST(OnTimeFit, SaysWhatHappened) {
  std::vector<ForecastStep> steps;
  append(steps, 60ms, 0.95, 2000);
  append(steps, 5ms, 0.4, 2000);
  OnTimeFit fit;
  fit.add(steps);
  const std::vector<Forecast> said = replayed(steps, fit.laws());
  ASSERT_EQ(said.size(), 4000U);
  EXPECT_NEAR(mean(said, 0, 2000), 0.95, 0.01);
  EXPECT_NEAR(mean(said, 2000, 4000), 0.4, 0.01);
}

TEST(OnTimeFit, PartsMakeTheSameAsAllAtOnce) {
  std::vector<ForecastStep> good;
  append(good, 60ms, 0.95, 300);
  std::vector<ForecastStep> bad;
  append(bad, 5ms, 0.4, 300);
  OnTimeFit at_once;
  at_once.add(good);
  at_once.add(bad);
  OnTimeFit fit;
  OnTimeFit part;
  fit.add(good);
  part.add(bad);
  fit.add(std::move(part));
  EXPECT_EQ(fit.messages(), at_once.messages());
  EXPECT_EQ(fit.laws().idle.weights, at_once.laws().idle.weights);
}

TEST(OnTimeFit, NothingIsEvenOdds) {
  std::vector<ForecastStep> steps;
  append(steps, 60ms, 1, 1);
  EXPECT_EQ(replayed(steps, OnTimeFit().laws()).at(0).predicted, 0.5);
}

}  // namespace
}  // namespace interneuron::load::on_time_fit_test
