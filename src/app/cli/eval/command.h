// `interneuron eval EXPERIMENT`: the paper's experiments and more, in virtual time.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command; `run` is set to what is to be done when it was chosen.
void add_eval(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
