// `interneuron links`: the network cards (NICs) of this host, what the kernel says of each and what
// was measured on it.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command; `run` is set to what is to be done when it was chosen.
void add_links(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
