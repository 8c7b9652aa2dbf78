// `interneuron report DIR`: a page of what `interneuron eval` has left in a folder.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command; `run` is set to what is to be done when it was chosen.
void add_report(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
