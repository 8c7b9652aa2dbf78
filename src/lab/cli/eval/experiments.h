// The table of the experiments of `interneuron eval`: what the lab runs in virtual time, and beside
// it what the testbed runs. Constant data, so any thread may read it.
#pragma once

#include <span>
#include <string>

#include "lab/eval/experiments/experiment.h"

namespace interneuron::cli {

// In the order in which `eval all` runs them and the report shows them.
std::span<const experiments::Experiment> all_experiments();
// The experiment of that name; nullptr when there is none.
const experiments::Experiment* find_experiment(const std::string& name);

}  // namespace interneuron::cli
