// Systems side by side on the same links, frames, delays and computation, seed by seed.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "lab/eval/bounds.h"
#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/experiment.h"
#include "lab/eval/metrics.h"
#include "lab/eval/run.h"

namespace interneuron::experiments {

struct Compared {
  eval::Scenario scenario;
  std::vector<eval::System> systems;
  // By system, then by seed.
  std::vector<std::vector<eval::Run>> runs;
  // By seed.
  std::vector<eval::Bound> oracle;
  // By seed; empty where the bound is not known for the scenario.
  std::vector<eval::Bound> causal;
};

// Runs every system on every seed, and the bounds too unless told otherwise. Throws
// process::Failure when interrupted.
Compared compare(const Request& request, const std::string& what, eval::Scenario scenario,
                 const std::vector<eval::System>& systems, bool bounds = true);

// Adds to a row what its rounds were really worth: all of them, and those on time.
using Scoring = std::function<void(SystemRow& row, const std::vector<ShownRound>& every,
                                   const std::vector<ShownRound>& on_time)>;

// One row per system, then one per bound; scored by the AP of the demo video. `score` is called on
// several threads at once.
std::vector<SystemRow> system_rows(const Request& request, const Compared& compared);
std::vector<SystemRow> system_rows(const Request& request, const Compared& compared,
                                   const Scoring& score);

// The columns of such rows.
std::vector<Column> system_columns();

// All systems() that make sense in this scenario. `jpeg`: its best variant is one.
std::vector<eval::System> all_systems(const eval::Scenario& scenario, bool jpeg);
std::vector<eval::System> some_systems(std::span<const char* const> names);

// The end-to-end times of the first seed, as a series for the figure.
void add_example(Document& document, const Compared& compared, const std::string& system);

// What a scenario is, in one line for tables.
std::string describe(const eval::Scenario& scenario);

}  // namespace interneuron::experiments
