// `interneuron testbed up | run | status | set | event | verify | down | list | schedule`: emulated
// modems for any program.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "netns/state/state.h"

namespace interneuron::cli {

// The testbed of this name; throws Failure (1) when it is not up.
netns::State found_testbed(const std::string& name);

// Adds the command; `run` is set to what is to be done when it was chosen.
void add_testbed(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
