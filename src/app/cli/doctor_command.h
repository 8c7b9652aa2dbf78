// `interneuron doctor`: is this host set up for several network cards (NICs) at once? Changes
// nothing.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command; `run` is set to what is to be done when it was chosen.
void add_doctor(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
