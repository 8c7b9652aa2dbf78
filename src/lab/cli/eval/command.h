// `interneuron eval EXPERIMENT`: the paper's experiments and more, in virtual time.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command. When the arguments name it, parsing sets `run` to what is to be done.
void add_eval(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
