// The testbed: one vehicle and one roadside unit on one machine, joined by emulated radio links.
//
//   vehicle netns                     middle netns (holder process)                    road netns
//   10.77.1.1  if5g ===veth=== v5g  [ LinkModel up/down of profile 5g ]  r5g ===veth===
//   if5g  10.77.1.2 10.77.2.1  if4g ===veth=== v4g  [ LinkModel up/down of profile 4g ]  r4g
//   ===veth=== if4g  10.77.2.2
//
// up() forks one *holder* process, which makes the namespaces, keeps them alive by file descriptors
// and then is the emulator. Nothing is bound into the file system but one state file, so the death
// of the holder, however it comes, frees everything. As root the namespaces are made directly,
// otherwise inside a new user namespace in which the caller is root.
//
// Time of the links starts with the first packet on any link (the epoch), so that one seed is one
// and the same drive however long the start took. Link i (from 0) reads emu::link_seed(seed, i).
//
// Errors: every function throws TestbedError, whose one-line text names the thing and the remedy.
// Thread-safety: none; up(), spawn() and run_in() fork, so call them from a thread that outlives
// the testbed (a holder that is not detached dies with that thread) and, best, before other threads
// start. Ownership: a Testbed owns its holder unless detached.
#pragma once

#include <sys/types.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "emu/link_model.h"
#include "emu/profile.h"
#include "interneuron/time.h"

namespace interneuron::netns {

// exit_code is what the program should exit with: 3 a bad profile, 5 a privilege is missing,
// 126/127 a command could not be run / was not found, 1 anything else.
class TestbedError : public std::runtime_error {
 public:
  TestbedError(int code, const std::string& what) : std::runtime_error(what), exit_code(code) {}
  int exit_code;
};

enum class Side : std::uint8_t { kVehicle, kRoad };

// One emulated link. The NIC is called "if" + name in both namespaces, so a name has 1..13
// characters of [A-Za-z0-9_-] (IFNAMSIZ allows 15) and is unique within its testbed.
struct LinkSpec {
  std::string name;
  emu::LinkProfile profile;
};

// The built-in profiles "5g" and "4g", in this order.
std::vector<LinkSpec> default_links();

// A link named and conditioned by `what`: the name of a built-in profile ("5g"), or the path of a
// TOML file, or NAME=either. Throws TestbedError (3) that names file, line, column and key.
LinkSpec load_link(const std::string& what);

// $XDG_RUNTIME_DIR/interneuron; without it /run/interneuron (root) or /tmp/interneuron-UID.
std::filesystem::path default_runtime_dir();

inline constexpr std::size_t kMaxLinks = 16;

struct TestbedOptions {
  std::string name = "default";                   // 1..64 characters of [A-Za-z0-9_-]
  std::vector<LinkSpec> links = default_links();  // 1..kMaxLinks
  std::uint64_t seed = 1;
  std::filesystem::path runtime_dir = default_runtime_dir();  // created with mode 0700
  // true: the holder outlives the caller until down(); false: it dies with the caller.
  bool detached = false;
};

// One link as it was set up. Addresses are IPv4 with prefix length 24, without it here.
struct TestbedLink {
  std::string name;             // "5g"
  std::string profile;          // name of its profile
  std::string nic;              // "if5g", in both namespaces
  std::string vehicle_address;  // "10.77.1.1"
  std::string road_address;     // "10.77.1.2"
};

// What the state file says: enough for another process to find, enter, watch and end a testbed.
struct State {
  std::string name;
  pid_t holder = 0;
  std::uint64_t holder_start_ticks = 0;  // field 22 of /proc/PID/stat: tells a reused pid apart
  bool detached = false;
  std::uint64_t seed = 0;
  std::vector<TestbedLink> links;
  // Numbers of file descriptors in the holder: /proc/HOLDER/fd/N.
  int user_ns_fd = -1;  // -1: no user namespace of its own
  int vehicle_ns_fd = -1;
  int road_ns_fd = -1;
  int stats_fd = -1;
  std::filesystem::path file;  // the state file
};

struct LinkSnapshot {
  std::string name;
  emu::DirectionStats up;    // vehicle -> roadside; IP bytes
  emu::DirectionStats down;  // roadside -> vehicle
};

// A reading of the running emulator. Counters are each exact but not all of one instant.
struct Snapshot {
  std::optional<TimePoint> epoch;  // CLOCK_MONOTONIC of the first packet; empty before it
  std::vector<LinkSnapshot> links;
  double lateness_mean_us = 0;  // of frames: when sent minus when due
  double lateness_max_us = 0;
  std::uint64_t frames_sent = 0;
  // Frames lost between kernel and emulator, in either direction: 0 unless the sender floods or a
  // NIC was set down.
  std::uint64_t kernel_drops = 0;
};

struct SpawnOptions {
  std::array<int, 3> stdio{-1, -1, -1};  // fds for stdin, stdout, stderr; -1 inherits the caller's
  bool die_with_parent = true;           // SIGTERM when the calling thread ends
};

class Testbed {
 public:
  // Makes everything and returns when all links are up and the emulator runs.
  // Refuses when a testbed of this name is up.
  static Testbed up(const TestbedOptions& options);

  // The testbed of this name that is up, if any. A state file left by a dead holder is removed.
  static std::optional<State> find(
      const std::string& name, const std::filesystem::path& runtime_dir = default_runtime_dir());
  // All that are up, by name.
  static std::vector<State> list(const std::filesystem::path& runtime_dir = default_runtime_dir());

  // Ends the holder (SIGTERM, after 2 s SIGKILL), waits for its end and removes the state file.
  // Fine if it is gone already. Processes that callers run inside are theirs to end; the kernel
  // frees namespaces and NICs with the last of them.
  static void down(const State& state);

  // Moves the calling process into one side. It must have one thread only; meant for a child after
  // fork().
  static void enter(const State& state, Side side);

  // Starts a program (found by PATH) inside one side; the caller reaps it. Throws when it cannot be
  // run.
  static pid_t spawn(const State& state, Side side, const std::vector<std::string>& argv,
                     const SpawnOptions& options = {});

  // Runs a program inside one side to its end, forwarding SIGINT and SIGTERM to it.
  // Returns its exit code, or 128 + signal.
  static int run_in(const State& state, Side side, const std::vector<std::string>& argv);

  static Snapshot snapshot(const State& state);

  Testbed(Testbed&& other) noexcept;
  Testbed& operator=(Testbed&& other) noexcept;
  // Ends the holder unless detached.
  ~Testbed();

  const State& state() const { return state_; }
  Snapshot snapshot() const { return snapshot(state_); }
  void down();

 private:
  explicit Testbed(State state);

  State state_;
  pid_t owner_ = 0;  // the process whose death or destructor ends it; 0 when detached or down
};

}  // namespace interneuron::netns
