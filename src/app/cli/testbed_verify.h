// `interneuron testbed verify`: holds the running links, as ping, iperf3 and tcpdump see them,
// against their own schedule.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command to `testbed`; `run` is set to what is to be done when it was chosen.
void add_testbed_verify(CLI::App& testbed, std::function<int()>& run);

}  // namespace interneuron::cli
