// Testbed::enter, spawn and run_in: how programs get into the namespaces of a testbed. The
// namespaces are opened as /proc/HOLDER/fd/N, the numbers of which the state file has.
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>

#include "netns/state/check.h"
#include "netns/state/error.h"
#include "netns/state/hosts.h"
#include "netns/state/state.h"
#include "netns/state/state_file.h"
#include "netns/testbed/testbed.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

namespace {

[[noreturn]] void fail_gone(const State& state) {
  throw TestbedError(
      1, "testbed '" + state.name + "' is not up any more; `interneuron testbed up` makes one");
}

// The namespaces of one host.
struct HostFds {
  // Empty when the caller is in the right user namespace already.
  io::FileDescriptor user;
  io::FileDescriptor network;
};

// Opens again what is open as `number` in the holder.
io::FileDescriptor open_fd_of(const State& state, int number) {
  const std::string path =
      "/proc/" + std::to_string(state.holder) + "/fd/" + std::to_string(number);
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd >= 0) return io::FileDescriptor(fd);
  if (errno == ENOENT) fail_gone(state);
  if (errno == EACCES || errno == EPERM) {
    throw TestbedError(
        5, "testbed '" + state.name + "' belongs to another user; become that user or root");
  }
  fail_errno("open " + path);
}

bool same_file(int fd, const char* path) {
  struct stat a {};
  struct stat b {};
  return ::fstat(fd, &a) == 0 && ::stat(path, &b) == 0 && a.st_ino == b.st_ino &&
         a.st_dev == b.st_dev;
}

// "vehicle to vehicle20", "road"
std::string list_hosts(Host first, std::size_t count) {
  const std::string last = host_name({first.kind, count - 1});
  if (count <= 2) return count == 1 ? last : host_name(first) + ", " + last;
  return host_name(first) + " to " + last;
}

int network_fd_of(const State& state, Host host) {
  if (host.kind == Host::Kind::kCore) return state.core_ns_fd;
  const bool vehicle = host.kind == Host::Kind::kVehicle;
  const std::vector<int>& fds = vehicle ? state.vehicle_ns_fds : state.road_ns_fds;
  if (host.index < fds.size()) return fds[host.index];
  throw TestbedError(2, "testbed '" + state.name + "' has no " + host_name(host) + "; it has " +
                            list_hosts(kVehicle, state.vehicle_ns_fds.size()) + ", " +
                            list_hosts(kRoad, state.road_ns_fds.size()) + ", core");
}

HostFds open_host(const State& state, Host host) {
  const int network_fd = network_fd_of(state, host);
  HostFds out;
  if (state.user_ns_fd >= 0) {
    out.user = open_fd_of(state, state.user_ns_fd);
    // The kernel refuses (EINVAL) to enter the user namespace in which the caller is.
    if (same_file(out.user.get(), "/proc/self/ns/user")) out.user = io::FileDescriptor();
  }
  out.network = open_fd_of(state, network_fd);
  // If the holder lives now, the files opened above were its own and not those of a later process
  // with the same number.
  if (!holder_alive(state)) fail_gone(state);
  return out;
}

// Returns errno, or 0 when inside. Allocates nothing, so that it may run in the forked child of a
// program with threads.
int enter_host(const HostFds& host) {
  if (host.user.get() >= 0 && ::setns(host.user.get(), CLONE_NEWUSER) != 0) return errno;
  return ::setns(host.network.get(), CLONE_NEWNET) != 0 ? errno : 0;
}

[[noreturn]] void fail_enter(const State& state, Host host, int error) {
  const std::string what = "enter " + host_name(host) + " of testbed '" + state.name + "'";
  if (error == EPERM) {
    throw TestbedError(
        5, "cannot " + what + ": not permitted; only root and the user who made it may");
  }
  fail_errno(what, error);
}

// What the child tells its parent through a pipe when it cannot become the program.
struct Failure {
  enum class Step : int { kEnter, kStdio, kExec } step;
  int error;
};

// In the child: enters the host and redirects stdio, or reports what failed and ends.
void set_up_child(const HostFds& host, const SpawnOptions& options, pid_t parent, int report) {
  const auto fail = [report](Failure::Step step) {
    const Failure failure{step, errno};
    [[maybe_unused]] const ssize_t written = ::write(report, &failure, sizeof failure);
    ::_exit(127);
  };
  errno = enter_host(host);
  if (errno != 0) fail(Failure::Step::kEnter);
  // Only after entering, because a change of credentials clears this setting.
  if (options.die_with_parent) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != parent) ::_exit(127);
  }
  for (int i = 0; i < 3; ++i) {
    const int fd = options.stdio[static_cast<std::size_t>(i)];
    if (fd >= 0 && fd != i && ::dup2(fd, i) < 0) fail(Failure::Step::kStdio);
  }
}

// Starts the program with `mask` as its blocked signals.
pid_t spawn_with_mask(const State& state, Host host, const std::vector<std::string>& argv,
                      const SpawnOptions& options, const sigset_t& mask) {
  if (argv.empty()) throw TestbedError(2, "no command to run; name one after --");
  const HostFds fds = open_host(state, host);
  std::vector<char*> arguments;
  for (const std::string& argument : argv) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  std::array<int, 2> ends{};
  check(::pipe2(ends.data(), O_CLOEXEC), "make a pipe");
  const io::FileDescriptor read_end(ends[0]);
  io::FileDescriptor write_end(ends[1]);

  const pid_t parent = ::getpid();
  const pid_t child = check(::fork(), "start " + argv[0]);
  if (child == 0) {
    set_up_child(fds, options, parent, write_end.get());
    ::sigprocmask(SIG_SETMASK, &mask, nullptr);
    ::execvp(arguments[0], arguments.data());
    const Failure failure{Failure::Step::kExec, errno};
    [[maybe_unused]] const ssize_t written = ::write(write_end.get(), &failure, sizeof failure);
    ::_exit(127);
  }
  { const io::FileDescriptor closed = std::move(write_end); }
  Failure failure{};
  // A successful exec closes the pipe before anything is written to it.
  if (::read(read_end.get(), &failure, sizeof failure) != sizeof failure) return child;
  ::waitpid(child, nullptr, 0);
  if (failure.step == Failure::Step::kEnter) fail_enter(state, host, failure.error);
  if (failure.step == Failure::Step::kStdio) fail_errno("redirect " + argv[0], failure.error);
  throw TestbedError(failure.error == ENOENT ? 127 : 126,
                     "cannot run '" + argv[0] + "': " + std::strerror(failure.error));
}

sigset_t forwarded_signals() {
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGINT);
  ::sigaddset(&signals, SIGTERM);
  return signals;
}

// Blocks the forwarded signals while it lives.
class SignalsHeld {
 public:
  SignalsHeld() {
    const sigset_t signals = forwarded_signals();
    ::pthread_sigmask(SIG_BLOCK, &signals, &previous_);
  }
  ~SignalsHeld() { ::pthread_sigmask(SIG_SETMASK, &previous_, nullptr); }
  SignalsHeld(const SignalsHeld&) = delete;
  SignalsHeld& operator=(const SignalsHeld&) = delete;

  const sigset_t& previous() const { return previous_; }

 private:
  sigset_t previous_{};
};

// Passes one pending signal on to the child. A signal from the terminal (SI_KERNEL) goes to the
// whole process group, so the child has got it already.
void forward_signal(int signals, pid_t child) {
  signalfd_siginfo info{};
  if (::read(signals, &info, sizeof info) != sizeof info || info.ssi_code == SI_KERNEL) return;
  ::kill(child, static_cast<int>(info.ssi_signo));
}

}  // namespace

void Testbed::enter(const State& state, Host host) {
  const int error = enter_host(open_host(state, host));
  if (error != 0) fail_enter(state, host, error);
}

pid_t Testbed::spawn(const State& state, Host host, const std::vector<std::string>& argv,
                     const SpawnOptions& options) {
  sigset_t mask;
  ::pthread_sigmask(SIG_SETMASK, nullptr, &mask);
  return spawn_with_mask(state, host, argv, options, mask);
}

int Testbed::run_in(const State& state, Host host, const std::vector<std::string>& argv) {
  const SignalsHeld held;
  const sigset_t forwarded = forwarded_signals();
  const io::FileDescriptor signals(
      check(::signalfd(-1, &forwarded, SFD_CLOEXEC), "make a signalfd"));
  const pid_t child = spawn_with_mask(state, host, argv, {}, held.previous());
  // By its number, because glibc has pidfd_open() only from 2.36 on.
  const io::FileDescriptor ended(
      check(static_cast<int>(::syscall(SYS_pidfd_open, child, 0)), "watch " + argv[0]));

  std::array<pollfd, 2> fds{{{ended.get(), POLLIN, 0}, {signals.get(), POLLIN, 0}}};
  while (fds[0].revents == 0) {
    if (::poll(fds.data(), fds.size(), -1) < 0 && errno != EINTR) fail_errno("wait for " + argv[0]);
    if (fds[1].revents != 0) forward_signal(signals.get(), child);
  }
  int status = 0;
  check(::waitpid(child, &status, 0), "wait for " + argv[0]);
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

}  // namespace interneuron::netns
