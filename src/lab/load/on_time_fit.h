// Fits the laws by which send() predicts (src/core/messages/on_time_weights.h) to runs of
// forecast_run.h. Pure; the same runs give the same laws. Thread-compatible.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/messages/on_time_forecast.h"
#include "lab/load/forecast_run.h"

namespace interneuron::load {

// What an OnTimeForecasts of these laws would have said of each judged message, in place of what
// was said.
std::vector<Forecast> replayed(std::span<const ForecastStep> steps, const OnTimeLaws& laws);

// Collects what was known of each judged message and whether it was on time, then fits each law: a
// logistic regression by Newton's method with a ridge, and the shares that were seen of what it
// says.
class OnTimeFit {
 public:
  void add(std::span<const ForecastStep> steps);
  // Takes over what another one has collected.
  void add(OnTimeFit&& other);
  // How many messages each law is fitted to, by OnTimeCase.
  std::array<std::size_t, 3> messages() const;
  // A law without messages is left at even odds.
  OnTimeLaws laws() const;

 private:
  struct Sample {
    std::array<float, kOnTimeFeatures> features{};
    bool on_time = false;
  };
  static OnTimeLaw law(std::span<const Sample> samples);

  // By OnTimeCase.
  std::array<std::vector<Sample>, 3> samples_;
};

}  // namespace interneuron::load
