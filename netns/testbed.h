// The testbed: vehicles and roadside units on one machine, joined by emulated radio links.
//
//   vehicle netns                                           core netns              road netns
//   if5g 10.77.1.2  ═══ link: up / down of profile 5g ═══  10.77.1.1 ┐         ┌ 10.77.0.1 if5g
//   if4g 10.78.1.2  ═══ link: up / down of profile 4g ═══  10.78.1.1 ┴ routes ─┴ 10.78.0.1 if4g
//
// Network n (from 1) is what the n-th modem of every vehicle is attached to. Vehicle v has
// 10.(76+n).v.2/24 there, its gateway is 10.(76+n).v.1, and fd77:0:n:v::2/64 behind fd77:0:n:v::1;
// roadside unit r has 10.(76+n).0.r/24 and fd77:0:n::r/64 (n, v, r in hexadecimal). Each NIC of a
// vehicle has a routing table of its own (100 + n) and a rule for its source address, as hosts with
// several modems have; the core routes, and, with nat, translates like a carrier's gateway.
//
// up() forks one *holder* process, which makes the namespaces, keeps them alive by file descriptors
// and drives the links: as tc-netem where the kernel has it (one veth pair per link, a qdisc at
// each end), else as the user-space emulator (two pairs per link, joined by the holder). Nothing is
// bound into the file system but one state file, so the death of the holder, however it comes,
// frees everything. As root the namespaces are made directly, otherwise inside a new user namespace
// in which the caller is root.
//
// Time of the links starts with the first packet on any link (the epoch), so that one seed is one
// and the same drive however long the start took. The first vehicle's links have the seeds of the
// scenario, those of further ones are derived from them.
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
#include "emu/scenario.h"
#include "interneuron/time.h"

namespace interneuron::netns {

// exit_code is what the program should exit with: 3 a bad profile, 5 a privilege is missing,
// 126/127 a command could not be run / was not found, 1 anything else.
class TestbedError : public std::runtime_error {
 public:
  TestbedError(int code, const std::string& what) : std::runtime_error(what), exit_code(code) {}
  int exit_code;
};

// One host of a testbed, which is one network namespace.
struct Host {
  enum class Kind : std::uint8_t { kVehicle, kRoad, kCore } kind = Kind::kVehicle;
  std::size_t index = 0;  // from 0; 0 for the core
  bool operator==(const Host&) const = default;
};
inline constexpr Host kVehicle{Host::Kind::kVehicle, 0};
inline constexpr Host kRoad{Host::Kind::kRoad, 0};
inline constexpr Host kCore{Host::Kind::kCore, 0};

// "vehicle" (or "vehicle1"), "vehicle2", ..., "road", "road2", ..., "core".
std::string host_name(Host host);
// Throws TestbedError (2) for anything else.
Host parse_host(const std::string& text);

// What makes the links: tc-netem of the kernel, or the user-space emulator. Auto: netem where the
// kernel has it and can do all that the profiles ask for.
enum class Backend : std::uint8_t { kAuto, kNetem, kEmulator };
const char* backend_name(Backend backend);  // "auto", "netem", "emulator"

// The built-in profiles "5g" and "4g", in this order. The NIC of a link is called "if" + its name
// in vehicles and roadside units, so names have 1..13 characters of [A-Za-z0-9_-] (IFNAMSIZ allows
// 15).
emu::Scenario default_scenario(std::uint64_t seed = 1);

// Links named and conditioned by `links`, each the name of a built-in profile ("5g"), or the path
// of a TOML file, or NAME=either. Throws TestbedError (3) that names file, line, column and key.
emu::Scenario scenario_of(const std::vector<std::string>& links, std::uint64_t seed);

// The scenario in this file; `seed` instead of the file's, if given. Throws likewise.
emu::Scenario load_scenario(const std::filesystem::path& file,
                            std::optional<std::uint64_t> seed = std::nullopt);

// Finds a profile by the name of a built-in one or by path, relative to `folder`; for emu's
// parsers.
emu::ProfileResolver profile_resolver(const std::filesystem::path& folder);

// $XDG_RUNTIME_DIR/interneuron; without it /run/interneuron (root) or /tmp/interneuron-UID.
std::filesystem::path default_runtime_dir();

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
  std::string control;         // abstract name of the holder's control socket (netns/control.h)
  std::string control_token;   // what a request must carry
  std::filesystem::path file;  // the state file

  std::size_t vehicle_count() const { return vehicle_ns_fds.size(); }
  std::size_t network_count() const { return links.size() / vehicle_ns_fds.size(); }
};

struct LinkSnapshot {
  std::string name;
  std::size_t vehicle = 0;
  emu::DirectionStats up;    // vehicle -> roadside; IP bytes
  emu::DirectionStats down;  // roadside -> vehicle
};

// What the model prescribed for one link at one of its steps (emu::kDelayStep).
struct ScheduleSample {
  Duration at{};   // since the epoch
  Duration rtt{};  // without queues
  double loss_up = 0;
  double loss_down = 0;
  DataRate rate_up{};
  DataRate rate_down{};
};

// A reading of the running links. Counters are each exact but not all of one instant.
struct Snapshot {
  std::optional<TimePoint> epoch;  // CLOCK_MONOTONIC of the first packet; empty before it
  std::vector<LinkSnapshot> links;
  // The emulator's alone, 0 with netem.
  double lateness_mean_us = 0;  // of frames: when sent minus when due
  double lateness_max_us = 0;
  std::uint64_t frames_sent = 0;
  // Frames lost between kernel and emulator, in either direction: 0 unless the sender floods or a
  // NIC was set down.
  std::uint64_t kernel_drops = 0;
  // netem's alone, 0 with the emulator.
  std::uint64_t netem_skipped = 0;  // steps that went by while one before was still at work
  std::uint64_t netem_put_off = 0;  // NICs that had to wait for the next step, summed over steps
  std::uint64_t netem_failed = 0;   // requests that the kernel refused
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

  // Moves the calling process into one host. It must have one thread only; meant for a child after
  // fork().
  static void enter(const State& state, Host host);

  // Starts a program (found by PATH) inside one host; the caller reaps it. Throws when it cannot be
  // run.
  static pid_t spawn(const State& state, Host host, const std::vector<std::string>& argv,
                     const SpawnOptions& options = {});

  // Runs a program inside one host to its end, forwarding SIGINT and SIGTERM to it.
  // Returns its exit code, or 128 + signal.
  static int run_in(const State& state, Host host, const std::vector<std::string>& argv);

  static Snapshot snapshot(const State& state);

  // What the model of link `index` prescribed between `from` and `to` since the epoch; at most the
  // last 80 s are kept. Empty before the epoch.
  static std::vector<ScheduleSample> schedule(const State& state, std::size_t index, Duration from,
                                              Duration to);

  // Indices into state.links of those called `which`: "5g" (of every vehicle), "vehicle2/5g", "*".
  // Throws TestbedError (1) when there is none.
  static std::vector<std::size_t> select(const State& state, const std::string& which);

  // From now on. `settings`: KEY=VALUE as emu::parse_change reads them; profile=NAME|FILE.toml.
  static void change(const State& state, const std::string& which,
                     const std::vector<std::string>& settings);
  // Nothing passes for this long, from now on.
  static void outage(const State& state, const std::string& which, Duration length);

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
