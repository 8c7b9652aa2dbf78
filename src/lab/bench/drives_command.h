// `interneuron bench drives`: what is missed while the rates of two modems change, beside each of
// them alone and a clairvoyant, as a table or JSON (docs/schema/drives.json).
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

void add_drives(CLI::App& bench, std::function<int()>& run);

}  // namespace interneuron::cli
