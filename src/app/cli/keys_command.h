// `interneuron keys`: makes keys, and tells public ones. fleet_keys.h has the rest of it.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command. When the arguments name it, parsing sets `run` to what is to be done.
void add_keys(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
