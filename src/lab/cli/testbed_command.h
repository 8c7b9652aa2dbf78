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

// Adds the command. When the arguments name it, parsing sets `run` to what is to be done.
void add_testbed(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
