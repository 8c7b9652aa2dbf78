// `interneuron bench forecast`: whether the chances that send() predicts are kept, in virtual time.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command to `bench`. When the arguments name it, parsing sets `run` to what is to be
// done.
void add_forecast(CLI::App& bench, std::function<int()>& run);

}  // namespace interneuron::cli
