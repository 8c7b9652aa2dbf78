// `interneuron bench coding`: what symbols, shares and shadows save, and what they cost in bytes,
// as a table or JSON (docs/schema/coding.json).
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

void add_coding(CLI::App& bench, std::function<int()>& run);

}  // namespace interneuron::cli
