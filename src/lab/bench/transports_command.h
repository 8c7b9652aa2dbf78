// `interneuron bench transports`: what the transports of a NIC cost, as a table or JSON
// (docs/schema/transports.json).
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

void add_transports(CLI::App& bench, std::function<int()>& run);

}  // namespace interneuron::cli
