// `interneuron demo`: a vehicle and a roadside unit in two network namespaces, joined by emulated
// modems.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace interneuron::cli {

struct DemoOptions {
  std::uint32_t rounds = 300;
  std::uint64_t seed = 1;
  std::string out = "out/demo";
  std::vector<std::string> links;  // profiles, default 5g and 4g
  std::string video;
  std::string data;
  std::string ladder = "auto";
  std::string policy = "down_sampling";
  std::string guard = "budget";
  double deadline_ms = 130;
  double objective = 0;
  bool json = false;
  std::string pcap;  // capture of the vehicle's packets; empty: none
};

int run_demo(const DemoOptions& options);

}  // namespace interneuron::cli
