// One run of the comparison on real sockets.
//
// A testbed is made for it: a host with the vehicle, one with the roadside unit, between them two
// modems with a link of the emulator each. Real time and a shared machine: figures differ from run
// to run; what the links do does not, but for the instants at which packets meet it.
//
// Errors: netns::TestbedError where namespaces are forbidden (5 or 77, as those commands have
// them); Failure when a program fails or a signal comes, for which a SignalWatch must be alive.
// Whatever way it ends, programs, namespaces and the files in `scratch` are gone.
// Thread-compatible.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "lab/peers_testbed/figures.h"

namespace interneuron::peers {

cli::Transport transport_of(const Run& run);

struct Ran {
  std::vector<Row> rows;
  // What makes the figures doubtful, one line; empty: nothing was seen.
  std::string doubt;
};

// `scratch` is a folder for the run's files, private to it; it is made if it is not there.
Ran play_run(const Run& run, const std::filesystem::path& scratch);

// How long a run takes, about.
Duration time_of_run(const Run& run);

}  // namespace interneuron::peers
