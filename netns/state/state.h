// What there is to know of a testbed that is up: its state file as a value. Written by the holder,
// read by every other process.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace interneuron::netns {

// What makes the links: tc-netem of the kernel, or the user-space emulator. Auto: netem where the
// kernel has it and can do all that the profiles ask for.
enum class Backend : std::uint8_t { kAuto, kNetem, kEmulator };
const char* backend_name(Backend backend);  // "auto", "netem", "emulator"

// $XDG_RUNTIME_DIR/interneuron; without it /run/interneuron (root) or /tmp/interneuron-UID.
std::filesystem::path default_runtime_dir();

// One link of one vehicle as it was set up. Addresses are without their prefix length.
struct TestbedLink {
  std::string name;              // "5g"
  std::size_t vehicle = 0;       // index of the vehicle
  std::string profile;           // name of its profile
  std::string nic;               // "if5g", in the vehicle and in every roadside unit
  std::string vehicle_address;   // "10.77.1.2"
  std::string gateway;           // "10.77.1.1"
  std::string road_address;      // "10.77.0.1", of the first roadside unit
  std::string vehicle_address6;  // "fd77:0:1:1::2"; empty where the kernel has no IPv6
  std::string gateway6;
  std::string road_address6;
};

// What the state file says: enough for another process to find, enter, watch and end a testbed.
struct State {
  std::string name;
  pid_t holder = 0;
  std::uint64_t holder_start_ticks = 0;  // field 22 of /proc/PID/stat: tells a reused pid apart
  bool detached = false;
  std::uint64_t seed = 0;
  Backend backend = Backend::kEmulator;  // never kAuto
  bool nat = false;
  std::vector<TestbedLink> links;  // all of the first vehicle, then all of the second, ...
  // Numbers of file descriptors in the holder: /proc/HOLDER/fd/N.
  int user_ns_fd = -1;              // -1: no user namespace of its own
  std::vector<int> vehicle_ns_fds;  // one per vehicle
  std::vector<int> road_ns_fds;     // one per roadside unit
  int core_ns_fd = -1;
  int stats_fd = -1;
  std::string control;  // abstract name of the holder's control socket (netns/state/control.h)
  std::string control_token;   // what a request must carry
  std::filesystem::path file;  // the state file

  std::size_t vehicle_count() const { return vehicle_ns_fds.size(); }
  std::size_t network_count() const { return links.size() / vehicle_ns_fds.size(); }
};

}  // namespace interneuron::netns
