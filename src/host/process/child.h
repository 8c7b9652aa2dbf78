// A process that we started and reap.
#pragma once

#include <sys/types.h>

#include <csignal>
#include <optional>

#include "interneuron/time.h"

namespace interneuron::cli {

// Ended and reaped at the latest by the destructor. Exit codes are the process's own, or 128 + the
// signal that ended it. Thread-compatible.
class Child {
 public:
  explicit Child(pid_t pid) : pid_(pid) {}
  ~Child() { end(); }
  Child(Child&& other) noexcept;
  Child& operator=(Child&& other) noexcept;

  // Waits for its end, however long it takes. A signal that our SignalWatch notes meanwhile is
  // passed on as one SIGTERM, a second later: a terminal's Ctrl-C has reached it already, and it
  // may be tidying up.
  int wait();
  // Sends the signal; after the grace SIGKILL. Harmless when it has ended.
  int end(int signal = SIGTERM, Duration grace = std::chrono::seconds(10));
  // Its exit code if it has ended by now.
  std::optional<int> ended();

 private:
  pid_t pid_;
  std::optional<int> code_;
};

}  // namespace interneuron::cli
