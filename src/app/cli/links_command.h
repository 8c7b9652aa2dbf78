// `interneuron links`: the network cards (NICs) of this host, what the kernel says of each and what
// was measured on it.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command. When the arguments name it, parsing sets `run` to what is to be done.
void add_links(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
