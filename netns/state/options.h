// What Testbed::up() is to make. A value; Testbed::up() checks it.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "lab/emu/scenario.h"
#include "netns/state/scenario.h"
#include "netns/state/state.h"

namespace interneuron::netns {

// The most links of a vehicle, vehicles and roadside units. Addresses allow 255 vehicles and 253
// roadside units (a byte of 10.x.v.0/24 and of 10.x.0.r); no measurement is behind these values,
// which only have to be smaller and larger than what experiments use.
inline constexpr std::size_t kMaxLinks = 16;
inline constexpr std::size_t kMaxVehicles = 100;
inline constexpr std::size_t kMaxRoads = 16;

struct TestbedOptions {
  // 1 to 64 characters of [A-Za-z0-9_-].
  std::string name = "default";
  emu::Scenario scenario = default_scenario();
  // 1 to kMaxVehicles; each has all links of the scenario.
  std::size_t vehicles = 1;
  // 1 to kMaxRoads.
  std::size_t roads = 1;
  Backend backend = Backend::kAuto;
  // Whether the core translates addresses as a carrier's gateway does (netns/wiring/wiring.cc).
  bool nat = false;
  // Where the state file is; made with mode 0700 if it is not there.
  std::filesystem::path runtime_dir = default_runtime_dir();
  // true: the holder lives until down(); false: it ends with the caller.
  bool detached = false;
};

}  // namespace interneuron::netns
