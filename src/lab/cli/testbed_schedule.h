// `interneuron testbed schedule`: what the model of a scenario's links prescribes, in virtual time.
#pragma once

#include <string>

#include "lab/emu/scenario.h"

namespace interneuron::cli {

// As CSV on stdout, or, when `plot` names one, drawn into that file, as PNG or SVG by its suffix.
// Returns the exit code.
int print_schedule(const emu::Scenario& scenario, Duration length, const std::string& plot);

}  // namespace interneuron::cli
