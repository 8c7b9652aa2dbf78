// How predicted chances of messages are judged (docs/load.md, "What send() predicts"): the runs in
// which every message's chance is noted beside what became of it, in virtual time, and how far
// what was predicted is kept. Pure; thread-safe: runs share nothing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lab/load/scenario.h"

namespace interneuron::load {

// What was predicted of a message, and what happened.
struct Forecast {
  // P(on time), in [0, 1].
  double predicted = 0;
  bool on_time = false;
  // send() refused the message; it was sent nevertheless.
  bool refused = false;
  // The run and its second in which the message was sent: messages of one second share their fate.
  std::uint64_t second = 0;
};

// Whether predicted chances are kept, for messages of which much the same was predicted.
struct Bin {
  // Means over the bin's messages.
  double predicted = 0;
  double happened = 0;
  std::size_t messages = 0;
  // That of happened - predicted, if only seconds are independent of each other and not the
  // messages within them.
  double standard_error = 0;

  double gap() const { return happened - predicted; }
  // Within two points and three standard errors.
  bool kept() const;
};

// A bin has at least so many messages, else it is joined to its neighbour.
inline constexpr std::size_t kLeastInBin = 2500;

// The mean square of prediction minus what happened, 1 or 0 (Brier, Verification of Forecasts
// Expressed in Terms of Probability, 1950): 0 is best, 0.25 what even odds get. 0 without
// forecasts.
double brier_score(std::span<const Forecast> forecasts);

// Bins of rising predictions. A last one that has too few is there alone where all have too few.
std::vector<Bin> calibration(std::span<const Forecast> forecasts, std::size_t least = kLeastInBin);

// Where predicted chances are judged: the loads of scenario.h, and links of driving profiles. One
// run: `run` says what is sent, at which seed, and through which bottleneck; with profiles the one
// vehicle has a link of each of them instead, and no bottleneck is shared.
struct ForecastScenario {
  // "rate", "driving 4g": predictions are judged by it.
  std::string name;
  Scenario run;
  // The names of profiles of tc_profiles/.
  std::vector<std::string> profiles;
};

// What is judged, in the order in which it is shown.
std::vector<std::string> forecast_names();

// The runs of a name with one seed; none for a name that is not among forecast_names().
std::vector<ForecastScenario> forecast_scenarios(const std::string& name, std::uint64_t seed);

// What was predicted of messages and what happened, in two runs of the same scenario and seed: of
// all that send() accepted in one as it is, and of those in the second that it refused and that
// were sent nevertheless, now and then, beside send(). What is predicted does not learn of these,
// and few enough are sent that the load is what it was.
std::vector<Forecast> forecasts(const ForecastScenario& scenario);

}  // namespace interneuron::load
