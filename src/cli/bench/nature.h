// `interneuron bench nature`: how soon the estimates and scores of a link follow steps of its
// delay, loss and rate, on a testbed of its own.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command `bench` and its parts; `run` is set to what is to be done when it was chosen.
void add_bench(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
