// Where predicted chances of messages are judged (docs/load.md, "What send() predicts"): the loads
// of scenario.h, and links of driving profiles. Plain values; pure; thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "lab/load/scenario.h"

namespace interneuron::load {

// One run: `run` says what is sent, at which seed, and through which bottleneck; with profiles the
// one vehicle has a link of each of them instead, and no bottleneck is shared.
struct ForecastScenario {
  // "rate", "driving 4g": predictions are judged by it.
  std::string name;
  Scenario run;
  // Of tc_profiles/.
  std::vector<std::string> profiles;
};

// What is judged, in the order in which it is shown.
std::vector<std::string> forecast_names();

// The runs of a name with one seed; none for a name that is not among forecast_names().
std::vector<ForecastScenario> forecast_scenarios(const std::string& name, std::uint64_t seed);

}  // namespace interneuron::load
