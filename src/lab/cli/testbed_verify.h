// `interneuron testbed verify`: holds the running links, as ping, iperf3 and tcpdump see them,
// against their own schedule.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace interneuron::cli {

// Adds the command to `testbed`. When the arguments name it, parsing sets `run` to what is to be
// done.
void add_testbed_verify(CLI::App& testbed, std::function<int()>& run);

}  // namespace interneuron::cli
