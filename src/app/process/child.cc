#include "app/process/child.h"

#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <thread>
#include <utility>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "app/process/whole_file.h"
#include "node/io/file_descriptor.h"
#include "node/io/steady_clock.h"

namespace interneuron::process {
namespace {

// How long end() and wait() sleep between two looks at the child.
constexpr Duration kNap = std::chrono::milliseconds(10);
// How long a child has after Ctrl-C before it gets SIGTERM. No measurement is behind this value: it
// only has to be larger than what a program takes to tidy up.
constexpr Duration kPassOnAfter = std::chrono::seconds(1);

[[noreturn]] void fail(const std::string& program, int error) {
  throw Failure(kFailed, file_problem("cannot run", program, error));
}

io::FileDescriptor memory_file(const std::string& program) {
  io::FileDescriptor memory(::memfd_create("interneuron-filter", MFD_CLOEXEC));
  if (memory.get() < 0) fail(program, errno);
  return memory;
}

std::string content_of(int fd, const std::string& program) {
  std::string out(static_cast<std::size_t>(std::max<off_t>(::lseek(fd, 0, SEEK_END), 0)), '\0');
  std::size_t done = 0;
  while (done < out.size()) {
    const ssize_t n = ::pread(fd, out.data() + done, out.size() - done, static_cast<off_t>(done));
    if (n < 0) fail(program, errno);
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  out.resize(done);
  return out;
}

}  // namespace

Child::Child(Child&& other) noexcept : pid_(std::exchange(other.pid_, -1)), code_(other.code_) {}

Child& Child::operator=(Child&& other) noexcept {
  std::swap(pid_, other.pid_);
  std::swap(code_, other.code_);
  return *this;
}

// A process that was reaped must not be signalled any more: its number may be another process's.
std::optional<int> Child::ended() {
  if (pid_ <= 0) return code_.value_or(kFine);
  int status = 0;
  const pid_t reaped = ::waitpid(pid_, &status, WNOHANG);
  if (reaped == 0 || (reaped < 0 && errno == EINTR)) return std::nullopt;
  if (reaped < 0) {
    code_ = kFailed;
  } else {
    code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  pid_ = -1;
  return code_;
}

int Child::wait() {
  std::optional<TimePoint> pass_on_at;
  for (;;) {
    if (const auto code = ended()) return *code;
    if (!pass_on_at && SignalWatch::last() != 0) pass_on_at = io::now() + kPassOnAfter;
    if (pass_on_at && io::now() >= *pass_on_at) {
      ::kill(pid_, SIGTERM);
      pass_on_at = TimePoint::max();
    }
    std::this_thread::sleep_for(kNap);
  }
}

int Child::end(int signal, Duration grace) {
  if (const auto code = ended()) return *code;
  ::kill(pid_, signal);
  bool killed = false;
  const TimePoint last_instant = io::now() + grace;
  for (;;) {
    if (const auto code = ended()) return *code;
    if (!killed && io::now() >= last_instant) {
      ::kill(pid_, SIGKILL);
      killed = true;
    }
    std::this_thread::sleep_for(kNap);
  }
}

Filtered filter(const std::string& input, std::vector<std::string> command) {
  const std::string program = command.front();
  const io::FileDescriptor in = memory_file(program);
  const io::FileDescriptor out = memory_file(program);
  if (const int error = write_all(in.get(), input); error != 0) fail(program, error);
  ::lseek(in.get(), 0, SEEK_SET);
  std::vector<char*> argv;
  for (std::string& word : command) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, in.get(), STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, out.get(), STDOUT_FILENO);
  pid_t pid = 0;
  Filtered result;
  result.start_error =
      ::posix_spawnp(&pid, program.c_str(), &actions, nullptr, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (result.start_error != 0) return result;
  result.code = Child(pid).wait();
  result.output = content_of(out.get(), program);
  return result;
}

}  // namespace interneuron::process
