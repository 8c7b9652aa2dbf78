// One scenario under load, run in virtual time.
//
// Pure; the same scenario gives the same row on any machine. Thread-safe: runs share nothing.
#pragma once

#include <functional>

#include "lab/load/figures.h"
#include "lab/sim/world.h"

namespace interneuron::load {

// `prepare` may look at the world, or change it, before the run begins.
Row run(const Scenario& scenario, const std::function<void(sim::World&)>& prepare = nullptr);

}  // namespace interneuron::load
