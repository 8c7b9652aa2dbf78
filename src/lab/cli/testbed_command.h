// The parts of `interneuron testbed`, which add_testbed() joins. Errors: Failure.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "lab/emu/scenario.h"
#include "netns/state/state.h"

namespace interneuron::cli {

// The testbed of this name; throws Failure (1) when it is not up.
netns::State found_testbed(const std::string& name);

// `interneuron testbed schedule`: what the model of a scenario's links prescribes, in virtual time.
// As CSV on stdout, or, when `plot` names one, drawn into that file, as PNG or SVG by its suffix.
// Returns the exit code.
int print_schedule(const emu::Scenario& scenario, Duration length, const std::string& plot);

// `interneuron testbed verify`: holds the running links, as ping, iperf3 and tcpdump see them,
// against their own schedule.
void add_testbed_verify(CLI::App& testbed, std::function<int()>& run);

}  // namespace interneuron::cli
