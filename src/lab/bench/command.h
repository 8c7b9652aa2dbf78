// `interneuron bench load`: on-time goodput against offered load, ours beside other transports, in
// virtual time.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command. When the arguments name it, parsing sets `run` to what is to be done.
void add_bench(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
