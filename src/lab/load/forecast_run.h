// Runs in which every message's predicted chance is noted beside what became of it, in virtual
// time. Pure; the same scenario gives the same on any machine. Thread-safe: runs share nothing.
#pragma once

#include <vector>

#include "lab/load/calibration.h"
#include "lab/load/forecast_scenario.h"

namespace interneuron::load {

// The predictions of accepted messages, and of refused ones. The latter are judged in a second run
// of the same seed, in which now and then one that send() refuses is sent nevertheless, beside
// send(): what it predicts does not learn of it, and few enough are sent that the load is what it
// was.
std::vector<Forecast> forecasts(const ForecastScenario& scenario);

}  // namespace interneuron::load
