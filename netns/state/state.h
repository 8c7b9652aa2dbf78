// Everything that a process has to know of a testbed that is up: the content of its state file as a
// value. The holder writes the file; every other process reads it (state_file.h).
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace interneuron::netns {

// What drives the links: tc-netem of the kernel or the user-space emulator. kAuto takes netem where
// the kernel has it and it can do all that the profiles ask for, else the emulator.
enum class Backend : std::uint8_t { kAuto, kNetem, kEmulator };
// "auto", "netem" or "emulator".
const char* backend_name(Backend backend);

// $XDG_RUNTIME_DIR/interneuron; without it /run/interneuron (root) or /tmp/interneuron-UID.
std::filesystem::path default_runtime_dir();

// One link of one vehicle as it was set up. Addresses have no prefix length; the examples are those
// of the first vehicle on the first network.
struct TestbedLink {
  // "5g"
  std::string name;
  // The vehicle's index, from 0.
  std::size_t vehicle = 0;
  // The name of the link's profile.
  std::string profile;
  // "if5g", in the vehicle and in every roadside unit.
  std::string nic;
  // "10.77.1.2"
  std::string vehicle_address;
  // "10.77.1.1"
  std::string gateway;
  // "10.77.0.1", the address of the first roadside unit.
  std::string road_address;
  // "fd77:0:1:1::2" and so on; empty where the kernel has no IPv6.
  std::string vehicle_address6;
  std::string gateway6;
  std::string road_address6;
};

// Enough for another process to find, enter, watch, change and end a testbed.
struct State {
  std::string name;
  // The holder's process number and the time at which it started (field 22 of /proc/PID/stat),
  // which tells it from a later process with the same number.
  pid_t holder = 0;
  std::uint64_t holder_start_ticks = 0;
  bool detached = false;
  std::uint64_t seed = 0;
  // Never kAuto.
  Backend backend = Backend::kEmulator;
  bool nat = false;
  // All links of the first vehicle, then all of the second, and so on.
  std::vector<TestbedLink> links;
  // The following are numbers of file descriptors in the holder, to be opened as /proc/HOLDER/fd/N:
  // the user namespace (-1 when the testbed has none of its own), the network namespaces of
  // vehicles, roadside units and core, and the shared counters.
  int user_ns_fd = -1;
  std::vector<int> vehicle_ns_fds;
  std::vector<int> road_ns_fds;
  int core_ns_fd = -1;
  int stats_fd = -1;
  // The abstract name of the holder's control socket, and the token that a request must carry
  // (netns/state/control.h).
  std::string control;
  std::string control_token;
  // The path of the state file.
  std::filesystem::path file;

  std::size_t vehicle_count() const { return vehicle_ns_fds.size(); }
  std::size_t network_count() const { return links.size() / vehicle_ns_fds.size(); }
};

}  // namespace interneuron::netns
