// `interneuron report DIR`: a page of what `interneuron eval` has left in a folder.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command. When the arguments name it, parsing sets `run` to what is to be done.
void add_report(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
