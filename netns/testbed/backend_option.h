// The option --backend of programs that make a testbed.
#pragma once

#include <CLI/CLI.hpp>

#include "netns/state/state.h"

namespace interneuron::netns {

// Adds --backend auto|netem|emulator, which sets `backend`. The command keeps a reference to it.
void add_backend_option(CLI::App& command, Backend& backend);

}  // namespace interneuron::netns
