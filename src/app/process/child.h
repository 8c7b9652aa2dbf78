// A process that this program started and will reap.
#pragma once

#include <sys/types.h>

#include <csignal>
#include <optional>

#include "interneuron/time.h"

namespace interneuron::process {

// Owns a child process: the destructor ends and reaps it at the latest. A process that has been
// reaped is never signalled, as its number may be another process's by then; so nothing else may
// wait for it. Exit codes are the process's own, or 128 + the signal that ended it.
// Thread-compatible.
class Child {
 public:
  explicit Child(pid_t pid) : pid_(pid) {}
  ~Child() { end(); }
  Child(Child&& other) noexcept;
  Child& operator=(Child&& other) noexcept;

  // Waits for its end, however long it takes, and returns its exit code. A signal that our
  // SignalWatch notes meanwhile is passed on as one SIGTERM, a second later, because a terminal's
  // Ctrl-C has reached the child already and it may be tidying up.
  int wait();
  // Sends the signal and, if it has not ended after the grace, SIGKILL; returns its exit code.
  // Harmless when it has ended.
  int end(int signal = SIGTERM, Duration grace = std::chrono::seconds(10));
  // Its exit code if it has ended by now.
  std::optional<int> ended();

 private:
  pid_t pid_;
  std::optional<int> code_;
};

}  // namespace interneuron::process
