#include "lab/cli/eval/experiments.h"

#include "lab/eval_testbed/testbed.h"

namespace interneuron::cli {
namespace {

using experiments::Experiment;

constexpr Experiment kExperiments[] = {
    {"table-network", "Delay of 4G and 5G while driving", 36'000, 30, false, false,
     experiments::run_table_network},
    {"fig-adjust", "What the adjustable qualities cost and are worth", 60, 10, true, false,
     experiments::run_fig_adjust},
    {"fig-rt", "The guard on the paper's scripted sequence", 13, 1, false, false,
     experiments::run_fig_rt},
    {"table-erdos", "Timeouts and accuracy under injected delays", 300, 30, true, true,
     experiments::run_table_erdos, eval_testbed::run_table_erdos_on_testbed},
    {"table-lidar", "Timeouts and agreement of a pipeline of point clouds", 300, 30, false, true,
     experiments::run_table_lidar},
    {"timeout-handler", "Consecutive timeouts with and without the handler", 300, 30, true, true,
     experiments::run_timeout_handler},
    {"ladder", "Which part earns what: baselines and ablations, paired", 300, 30, false, true,
     experiments::run_ladder},
    {"clock", "Wrong clocks: offset, drift, step", 300, 10, false, true, experiments::run_clock},
    {"sweep", "Deadlines from 60 to 200 ms and delays from none to twice", 300, 5, true, true,
     experiments::run_sweep}};

}  // namespace

std::span<const Experiment> all_experiments() { return kExperiments; }

const Experiment* find_experiment(const std::string& name) {
  for (const Experiment& e : kExperiments) {
    if (e.name == name) return &e;
  }
  return nullptr;
}

}  // namespace interneuron::cli
