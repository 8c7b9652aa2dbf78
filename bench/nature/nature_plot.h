// The picture that `nature_bench` draws of its runs, by gnuplot.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/nature/nature_steps.h"

namespace interneuron::bench {

// One run: a phase at the base conditions, one phase per step, and an outage at the end. Times are
// since the start of the run.
struct Run {
  bool loaded = false;
  // When each step was made.
  std::vector<Duration> began;
  // When the phase of the last step ended.
  Duration end{};
  std::vector<Belief> beliefs;
  // One per step.
  std::vector<Convergence> convergence;
  Duration outage_began{};
  OutageNotice outage;
};

// Draws a column per run with round trip, rate, loss and the three scores that move, one below the
// other; dashed lines are the conditions that the link was set to. Returns false, with a line on
// stderr, where gnuplot is missing or fails.
bool plot_nature(const std::filesystem::path& file, const std::vector<Run>& runs);

}  // namespace interneuron::bench
