// `interneuron bench peers`: Interneuron beside other transports over two emulated modems.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command to `bench`. When the arguments name it, parsing sets `run` to what is to be
// done.
void add_peers(CLI::App& bench, std::function<int()>& run);

}  // namespace interneuron::cli
