// The part of `interneuron keys` that is for a fleet authority: signs the keys of vehicles, looks
// at what was signed, and takes keys back.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the commands to `keys`. When the arguments name one, parsing sets `run` to what is to be
// done.
void add_fleet_keys(CLI::App& keys, std::function<int()>& run);

}  // namespace interneuron::cli
