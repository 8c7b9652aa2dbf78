// `interneuron doctor`: is this host set up for several network cards (NICs) at once? Changes
// nothing.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command. When the arguments name it, parsing sets `run` to what is to be done.
void add_doctor(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
