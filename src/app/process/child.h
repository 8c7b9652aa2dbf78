// Processes that this program starts and will reap.
#pragma once

#include <sys/types.h>

#include <csignal>
#include <optional>
#include <string>
#include <vector>

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

// Runs a program as a filter: it reads what we give it and we get what it prints. Both lie in files
// without names in memory, so that neither waits for the other and nothing is left anywhere. Its
// messages go to our stderr. Thread-compatible.
struct Filtered {
  // The errno with which it could not be started; 0: it ran.
  int start_error = 0;
  // Its exit code, or 128 and the number of the signal that ended it.
  int code = 0;
  std::string output;
};

// The first of `command` is looked for in PATH. Throws Failure (1) when there is no memory or no
// descriptor for it.
Filtered filter(const std::string& input, std::vector<std::string> command);

}  // namespace interneuron::process
