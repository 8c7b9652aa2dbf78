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
// The time of the links begins with the first packet on any of them (the epoch), so that one seed
// gives the same drive however long the start took. The first vehicle's links have the seeds of
// the scenario; the seeds of other vehicles' links are derived from those.
//
// Who may use a testbed: its state file and its holder's descriptors can be opened by the user who
// made it and by root alone; everybody else gets TestbedError (5).
//
// Errors: every function throws TestbedError, whose one-line text names the thing and the remedy.
// Not thread-safe: up(), spawn() and run_in() fork, so call them from a thread that outlives the
// testbed (a holder that is not detached dies with that thread) and, if possible, before other
// threads start. A Testbed owns its holder unless it is detached.
#pragma once

#include <sys/types.h>

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/time.h"
#include "netns/state/error.h"
#include "netns/state/hosts.h"
#include "netns/state/options.h"
#include "netns/state/snapshot.h"
#include "netns/state/state.h"

namespace interneuron::netns {

struct SpawnOptions {
  // File descriptors that become stdin, stdout and stderr; -1 inherits the caller's.
  std::array<int, 3> stdio{-1, -1, -1};
  // The kernel sends SIGTERM to the program when the calling thread ends.
  bool die_with_parent = true;
};

class Testbed {
 public:
  // Makes everything and returns when all links are up and carry packets.
  // Throws when a testbed of this name is up already.
  static Testbed up(const TestbedOptions& options);

  // The testbed of this name, if it is up. Removes a state file that a dead holder has left.
  static std::optional<State> find(
      const std::string& name, const std::filesystem::path& runtime_dir = default_runtime_dir());
  // All testbeds that are up, in the order of their names.
  static std::vector<State> list(const std::filesystem::path& runtime_dir = default_runtime_dir());

  // Ends the holder (SIGTERM, after 2 s SIGKILL), waits for its end and removes the state file.
  // Does nothing when the holder has ended already. Does not end the programs that callers run
  // inside; the kernel frees namespaces and NICs when the last of them has ended.
  static void down(const State& state);

  // Moves the calling process into one host. The process must have one thread; meant for a child
  // after fork().
  static void enter(const State& state, Host host);

  // Starts a program (found by PATH) inside one host and returns its process id, for which the
  // caller waits. Throws when the program cannot be run.
  static pid_t spawn(const State& state, Host host, const std::vector<std::string>& argv,
                     const SpawnOptions& options = {});

  // Runs a program inside one host to its end, forwarding SIGINT and SIGTERM to it.
  // Returns its exit code, or 128 + signal.
  static int run_in(const State& state, Host host, const std::vector<std::string>& argv);

  // The present counters of all links.
  static Snapshot snapshot(const State& state);

  // What the model of link `index` prescribed between `from` and `to`, both since the epoch. The
  // last 80 s are kept; before the epoch the result is empty.
  static std::vector<ScheduleSample> schedule(const State& state, std::size_t index, Duration from,
                                              Duration to);

  // What the carrier of link `index` does to one direction beside delay, loss and rate: of the
  // result policer, shaper, grants, hybrid ARQ and sleep alone are set, as they are now.
  static emu::DirectionParams carrier(const State& state, std::size_t index,
                                      emu::Direction direction);

  // Indices into state.links of the links called `which`: "5g" (of every vehicle), "vehicle2/5g",
  // "vehicle2/*" or "*". Throws TestbedError (1) when there is none.
  static std::vector<std::size_t> select(const State& state, const std::string& which);

  // Changes links from now on. `settings`: KEY=VALUE as emu::parse_change reads them, or
  // profile=NAME or profile=FILE.toml.
  static void change(const State& state, const std::string& which,
                     const std::vector<std::string>& settings);
  // Begins anew what cells measure of their queues (CellDirection): what came before was a warm-up.
  static void measure_cells(const State& state);
  // Lets nothing pass over these links for `length` from now on.
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
  // The process whose destructor of this object ends the holder; 0 when detached or down. A fork
  // has a copy of this object with the same owner, and so leaves the holder alone.
  pid_t owner_ = 0;
};

}  // namespace interneuron::netns
