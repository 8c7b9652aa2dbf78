// What a testbed is to be made of.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "lab/emu/scenario.h"
#include "netns/state/scenario.h"
#include "netns/state/state.h"

namespace interneuron::netns {

inline constexpr std::size_t kMaxLinks = 16;      // per vehicle
inline constexpr std::size_t kMaxVehicles = 100;  // 2 namespaces' worth of NICs each
inline constexpr std::size_t kMaxRoads = 16;

struct TestbedOptions {
  std::string name = "default";  // 1..64 characters of [A-Za-z0-9_-]
  emu::Scenario scenario = default_scenario();
  std::size_t vehicles = 1;  // 1..kMaxVehicles; each has all links of the scenario
  std::size_t roads = 1;     // 1..kMaxRoads
  Backend backend = Backend::kAuto;
  // The core translates the vehicles' addresses to its own, one per network, and forgets idle
  // mappings (nftables): what a carrier's gateway does.
  bool nat = false;
  std::filesystem::path runtime_dir = default_runtime_dir();  // created with mode 0700
  // true: the holder outlives the caller until down(); false: it dies with the caller.
  bool detached = false;
};

}  // namespace interneuron::netns
