// All runs of `bench peers`, one after the other.
#pragma once

#include <exception>
#include <string>
#include <vector>

#include "lab/peers_testbed/figures.h"

namespace interneuron::peers {

// A peer that this machine cannot run, and why, one line that does not name it.
struct Skipped {
  std::string peer;
  std::string reason;
};

struct Compared {
  std::vector<Row> rows;
  std::vector<Skipped> skipped;
  // What ended the series before its last run, a signal mostly: rows are those of the runs before.
  std::exception_ptr ended;
};

// Runs what this machine can and tells on stderr which peers are left out and why, how far it is,
// and what makes a row doubtful. A SignalWatch must be alive. Throws Failure (77) when nothing is
// left, and what the first play_run() throws.
Compared compare(const std::vector<Run>& runs);

}  // namespace interneuron::peers
