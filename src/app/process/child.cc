#include "app/process/child.h"

#include <sys/wait.h>

#include <cerrno>
#include <thread>
#include <utility>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "node/io/steady_clock.h"

namespace interneuron::process {

namespace {

// How long end() and wait() sleep between two looks at the child.
constexpr Duration kNap = std::chrono::milliseconds(10);
// How long a child has after Ctrl-C before it gets SIGTERM. No measurement is behind this value: it
// only has to be larger than what a program takes to tidy up.
constexpr Duration kPassOnAfter = std::chrono::seconds(1);

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

}  // namespace interneuron::process
