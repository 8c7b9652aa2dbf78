// The commands of `interneuron-lab`. add_NAME() adds one; when the arguments name it, parsing sets
// `run` to what is to be done, which returns the exit code and throws Failure.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "app/offload/road.h"
#include "app/offload/vehicle.h"
#include "lab/emu/scenario.h"
#include "netns/state/state.h"

namespace interneuron::cli {

// `interneuron demo`: a vehicle and a roadside unit in two network namespaces, joined by emulated
// modems.
struct DemoOptions {
  std::uint32_t rounds = 300;
  std::uint64_t seed = 1;
  std::string out = "out/demo";
  // Profiles by name or file; none: 5g and 4g.
  std::vector<std::string> links;
  std::string video;
  std::string data;
  std::string ladder = "auto";
  // Runs per level in which the roadside unit measures its detectors before the first round.
  int calibration_runs = offload::RoadOptions{}.calibration_runs;
  // As VehicleOptions.
  std::string images = offload::VehicleOptions{}.images;
  std::string policy = offload::VehicleOptions{}.policy;
  std::string guard = "budget";
  double deadline_ms = 130;
  double objective = 0;
  bool json = false;
  // The file that captures the vehicle's packets; empty: none.
  std::string pcap;
};

// Makes a testbed, runs both programs in it and returns the exit code. A signal ends all of it:
// then the code is 128 + the signal, the rounds that were measured are written, and without a round
// no file is. Throws Failure or netns::TestbedError.
int run_demo(const DemoOptions& options);

void add_demo(CLI::App& program, std::function<int()>& run);

// `interneuron testbed up | run | status | set | event | verify | down | list | schedule`: emulated
// modems for any program.
void add_testbed(CLI::App& program, std::function<int()>& run);

// The testbed of this name; throws Failure (1) when it is not up.
netns::State found_testbed(const std::string& name);

// `interneuron testbed schedule`: what the model of a scenario's links prescribes, in virtual time.
// As CSV on stdout, or, when `plot` names one, drawn into that file, as PNG or SVG by its suffix.
// Returns the exit code.
int print_schedule(const emu::Scenario& scenario, Duration length, const std::string& plot);

// `interneuron testbed verify`: holds the running links, as ping, iperf3 and tcpdump see them,
// against their own schedule.
void add_testbed_verify(CLI::App& testbed, std::function<int()>& run);

// `interneuron eval EXPERIMENT`: the paper's experiments and more, in virtual time.
void add_eval(CLI::App& program, std::function<int()>& run);

// `interneuron report DIR`: a page of what `interneuron eval` has left in a folder.
void add_report(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
