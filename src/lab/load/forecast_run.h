// Runs in which every message's predicted chance is noted beside what became of it, in virtual
// time. Pure; the same scenario gives the same on any machine. Thread-safe: runs share nothing.
#pragma once

#include <vector>

#include "lab/load/calibration.h"
#include "lab/load/forecast_scenario.h"

namespace interneuron::load {

// What was predicted of messages and what happened, in two runs of the same scenario and seed: of
// all that send() accepted in one as it is, and of those in the second that it refused and that
// were sent nevertheless, now and then, beside send(). What is predicted does not learn of these,
// and few enough are sent that the load is what it was.
std::vector<Forecast> forecasts(const ForecastScenario& scenario);

}  // namespace interneuron::load
