// The option --backend of programs that make a testbed.
#pragma once

#include <CLI/CLI.hpp>

#include "netns/state/state.h"

namespace interneuron::cli {

// --backend auto|netem|emulator; `backend` must live as long as the program parses and runs.
void add_backend_option(CLI::App& command, netns::Backend& backend);

}  // namespace interneuron::cli
