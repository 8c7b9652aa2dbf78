// `interneuron demo`: a vehicle and a roadside unit in two network namespaces, joined by emulated
// modems.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "app/offload/road.h"
#include "app/offload/vehicle.h"

namespace interneuron::cli {

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

// Adds the command. When the arguments name it, parsing sets `run` to what is to be done.
void add_demo(CLI::App& program, std::function<int()>& run);

}  // namespace interneuron::cli
