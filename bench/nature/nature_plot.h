// The picture of The program `nature_bench`.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/nature/nature_steps.h"

namespace interneuron::cli::bench {

// One run: a phase at the base conditions, then one per step.
struct Run {
  bool loaded = false;
  std::vector<Duration> began;  // of each step, since the start of the run
  Duration end{};
  std::vector<Belief> beliefs;
  std::vector<Convergence> convergence;  // one per step
  Duration outage_began{};
  OutageNotice outage;
};

// A column per run; below each other round trip, rate, loss and the three scores that move, dashed
// what the link is set to. False (and a line on stderr) without gnuplot.
bool plot_nature(const std::filesystem::path& file, const std::vector<Run>& runs);

}  // namespace interneuron::cli::bench
