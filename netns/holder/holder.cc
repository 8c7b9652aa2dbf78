#include "netns/holder/holder.h"

#include <fcntl.h>
#include <linux/close_range.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <functional>
#include <memory>

#include "lab/emu/link.h"
#include "netns/emulator/emulator.h"
#include "netns/netem/netem_backend.h"
#include "netns/netem/qdisc.h"
#include "netns/state/bearers.h"
#include "netns/state/check.h"
#include "netns/state/control.h"
#include "netns/state/shared_stats.h"
#include "netns/state/state_file.h"
#include "netns/wiring/namespaces.h"
#include "netns/wiring/wiring.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

namespace {

// How long the maker waits for the holder. Making twenty vehicles takes a second or two; it can
// take longer while the kernel is still freeing other namespaces.
constexpr int kStartBoundMs = 20'000;

// The holder answers its maker through a pipe, in one write: "0" when it is ready, else an exit
// code, a space and a text.
constexpr const char* kReady = "0";

// Writes to the pipe. False when the maker has gone or has given up waiting.
bool report(int pipe, const std::string& text) {
  return ::write(pipe, text.data(), text.size()) == static_cast<ssize_t>(text.size());
}

// Has the kernel end the holder with its maker. The maker may have died before this call took
// effect, hence the look at the parent afterwards.
void die_with(pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
}

// Gives up what the holder has inherited from its maker: terminal, signal settings, working
// directory and open files, of which a pipe kept open would make its reader wait for ever.
void become_daemon(int report_pipe, bool keep_stderr) {
  ::setsid();
  [[maybe_unused]] const int directory = ::chdir("/");
  const int null = check(::open("/dev/null", O_RDWR), "open /dev/null");
  ::dup2(null, STDIN_FILENO);
  ::dup2(null, STDOUT_FILENO);
  if (!keep_stderr) ::dup2(null, STDERR_FILENO);
  const auto pipe = static_cast<unsigned>(report_pipe);
  ::close_range(STDERR_FILENO + 1, pipe - 1, 0);
  ::close_range(pipe + 1, ~0U, 0);
  for (const int signal : {SIGINT, SIGHUP, SIGPIPE, SIGTSTP}) ::signal(signal, SIG_IGN);
  for (const int signal : {SIGCHLD, SIGABRT, SIGSEGV, SIGALRM}) ::signal(signal, SIG_DFL);
  // The kernel keeps 15 characters.
  ::prctl(PR_SET_NAME, "interneuron-emu");
}

// A descriptor that becomes readable when SIGTERM arrives, which is blocked from then on.
io::FileDescriptor termination_fd() {
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGTERM);
  ::sigprocmask(SIG_SETMASK, &signals, nullptr);
  return io::FileDescriptor(check(::signalfd(-1, &signals, SFD_CLOEXEC), "make a signalfd"));
}

struct Shared {
  io::FileDescriptor fd;
  SharedStats* stats;
};

// Mapped until the process ends.
Shared make_shared_stats(std::size_t links) {
  const std::size_t bytes = SharedStats::bytes(links);
  io::FileDescriptor fd(
      check(::memfd_create("interneuron-stats", MFD_CLOEXEC), "make shared memory"));
  check(::ftruncate(fd.get(), static_cast<off_t>(bytes)), "size shared memory");
  void* memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd.get(), 0);
  if (memory == MAP_FAILED) fail_errno("map shared memory");
  return {std::move(fd), SharedStats::construct(memory, links)};
}

// The first thing in a scenario that tc-netem cannot do; empty when it can do everything.
std::string beyond_netem(const emu::Scenario& scenario) {
  for (const emu::ScenarioLink& link : scenario.links) {
    const auto missing = emu::netem_cannot(link.profile);
    if (!missing.empty())
      return "what profile '" + link.profile.name + "' asks for: " + missing.front();
  }
  if (!scenario.cells.empty()) return "cells that links share";
  for (const emu::ScenarioEvent& event : scenario.events) {
    const auto missing = emu::netem_cannot(event.change);
    if (!missing.empty()) {
      return "the event at " + std::to_string(to_ms(event.at) / 1e3) + " s: " + missing.front();
    }
  }
  return "";
}

// Which back end to use; tries netem in the current network namespace, which must be one of the
// testbed. In the user's own, root may lack the rights (in a container) to find out.
Backend choose_backend(const TestbedOptions& options) {
  if (options.backend == Backend::kEmulator) return Backend::kEmulator;
  const bool asked = options.backend == Backend::kNetem;
  if (!kernel_has_netem()) {
    if (!asked) return Backend::kEmulator;
    throw TestbedError(
        1,
        "this kernel has no tc-netem (sch_netem); `modprobe sch_netem` as root may "
        "load it, --backend emulator does without, scripts/vm.sh has one that has it");
  }
  const std::string missing = beyond_netem(options.scenario);
  if (missing.empty()) return Backend::kNetem;
  if (!asked) return Backend::kEmulator;
  throw TestbedError(3, "tc-netem cannot do " + missing + "; --backend emulator can");
}

// Notes in `state` the holder's process and the descriptors that others open through /proc.
void name_descriptors(State& state, const Namespaces& namespaces, const Shared& shared) {
  state.holder = ::getpid();
  state.holder_start_ticks = start_ticks(state.holder).value_or(0);
  state.user_ns_fd = namespaces.user.get();
  for (const auto& vehicle : namespaces.vehicles) state.vehicle_ns_fds.push_back(vehicle.get());
  for (const auto& road : namespaces.roads) state.road_ns_fds.push_back(road.get());
  state.core_ns_fd = namespaces.core.get();
  state.stats_fd = shared.fd.get();
}

// The whole life of a holder after become_daemon().
void hold(const TestbedOptions& options, State state, pid_t maker, int report_pipe) {
  const io::FileDescriptor stop = termination_fd();
  // Requests come from the user's network namespace, which is still ours here.
  ControlServer control;
  state.control = control.name();
  state.control_token = control.token();
  // Lets processes of the same user open /proc/PID/fd, and this one write its own uid_map.
  ::prctl(PR_SET_DUMPABLE, 1);
  const Namespaces namespaces = make_namespaces(options.vehicles, options.roads);
  // Both settings again, because a change of credentials (a new user namespace) may clear them.
  ::prctl(PR_SET_DUMPABLE, 1);
  if (!options.detached) die_with(maker);
  state.backend = choose_backend(options);
  wire(state, options, namespaces);
  const Shared shared = make_shared_stats(state.links.size());
  Bearers bearers(options, state.backend, control, *shared.stats);
  NicKeeper keeper(state, options, namespaces);
  bearers.attend(keeper.fd(), [&keeper] { keeper.serve(); });
  name_descriptors(state, namespaces, shared);

  std::function<void()> run;
  if (state.backend == Backend::kNetem) {
    auto backend = std::make_shared<NetemBackend>(state, namespaces, bearers);
    run = [&stop, backend] { backend->run(stop.get()); };
  } else {
    auto backend = std::make_shared<Emulator>(state, bearers);
    run = [&stop, backend] { backend->run(stop.get()); };
  }
  write_state(state);
  // If the maker has gone, nobody knows of this testbed, and it ends.
  const bool wanted = report(report_pipe, kReady);
  ::close(report_pipe);
  if (wanted) run();
  ::unlink(state.file.c_str());
}

[[noreturn]] void holder_main(const TestbedOptions& options, const State& state, pid_t maker,
                              int report_pipe) {
  try {
    if (!options.detached) die_with(maker);
    become_daemon(report_pipe, !options.detached);
    hold(options, state, maker, report_pipe);
    ::_exit(0);
  } catch (const TestbedError& error) {
    report(report_pipe, std::to_string(error.exit_code) + " " + error.what());
  } catch (const std::exception& error) {
    report(report_pipe, std::string("1 ") + error.what());
  }
  ::_exit(1);
}

// Everything that the holder wrote until it closed the pipe or ended, or an error text when that
// takes longer than kStartBoundMs. A signal that the maker catches does not cut this short: the
// maker can only obey it when it knows what there is to take down.
std::string read_report(int pipe) {
  std::string text;
  std::array<char, 1024> buffer{};
  pollfd readable{pipe, POLLIN, 0};
  for (;;) {
    const int ready = ::poll(&readable, 1, kStartBoundMs);
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) break;
    const ssize_t count = ::read(pipe, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return text;
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
  return "1 the testbed was not ready after " + std::to_string(kStartBoundMs / 1000) + " s";
}

// Forks once, or twice for a detached holder: that is then a child of init, which reaps it, and
// leaves no zombie here.
pid_t fork_holder(const TestbedOptions& options, const State& state, int report_pipe) {
  const pid_t maker = ::getpid();
  const pid_t child = check(::fork(), "start the holder");
  if (child > 0) return child;
  if (options.detached) {
    const pid_t grandchild = ::fork();
    if (grandchild != 0) ::_exit(grandchild > 0 ? 0 : 1);
  }
  holder_main(options, state, maker, report_pipe);
}

}  // namespace

void start_holder(const TestbedOptions& options, State& state) {
  std::array<int, 2> ends{};
  check(::pipe2(ends.data(), O_CLOEXEC), "make a pipe");
  const io::FileDescriptor read_end(ends[0]);
  pid_t child = 0;
  {
    const io::FileDescriptor write_end(ends[1]);
    child = fork_holder(options, state, write_end.get());
  }
  if (options.detached) ::waitpid(child, nullptr, 0);

  const std::string text = read_report(read_end.get());
  if (text == kReady) {
    const auto written = read_state(state.file);
    if (!written) throw TestbedError(1, "the state file " + state.file.string() + " has vanished");
    state = *written;
    return;
  }
  if (!options.detached) {
    // The holder is ending after its report, or it hangs.
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
  }
  const std::size_t space = text.find(' ');
  if (space == std::string::npos) throw TestbedError(1, "the testbed's holder died while starting");
  throw TestbedError(std::stoi(text), text.substr(space + 1));
}

}  // namespace interneuron::netns
