// Systems side by side on the same links, frames, delays and computation, seed by seed.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "lab/eval/bounds.h"
#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/experiment.h"
#include "lab/eval/metrics.h"
#include "lab/eval/run.h"

namespace interneuron::cli::eval {

struct Compared {
  interneuron::eval::Scenario scenario;
  std::vector<interneuron::eval::System> systems;
  std::vector<std::vector<interneuron::eval::Run>> runs;  // [system][seed]
  std::vector<interneuron::eval::Bound> oracle;           // [seed]
  std::vector<interneuron::eval::Bound> causal;           // [seed], or empty: not for this scenario
};

// Throws Failure when interrupted.
Compared compare(const Request& request, const std::string& what,
                 const interneuron::eval::Scenario& scenario,
                 const std::vector<interneuron::eval::System>& systems, bool bounds = true);

// One row per system and bound; with the keys of docs/schema/eval.json.
Json rows_of(const Request& request, const Compared& compared);

// The columns of such rows.
std::vector<Column> system_columns();

// All systems() that make sense with these variants; requires: systems() has them.
std::vector<interneuron::eval::System> all_systems(bool jpeg);
std::vector<interneuron::eval::System> some_systems(std::span<const char* const> names);

// The end-to-end times of the first seed, as a series for the figure.
void add_example(Json& document, const Compared& compared, const std::string& system);

// What a scenario is, in one line for tables.
std::string describe(const interneuron::eval::Scenario& scenario);

}  // namespace interneuron::cli::eval
