// Runs of the forecast's scenarios, short ones.
#pragma once

#include <string>

#include "lab/load/forecast.h"

namespace interneuron::load {

// The first run of this name at this load, or of any where it is 0, of this length.
inline ForecastScenario first(const std::string& name, double load, Duration length) {
  for (ForecastScenario s : forecast_scenarios(name, 1)) {
    if (load > 0 && s.run.load != load) continue;
    s.run.length = length;
    return s;
  }
  return {};
}

}  // namespace interneuron::load
