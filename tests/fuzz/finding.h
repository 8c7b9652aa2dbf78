// How a fuzz target ends the program where an invariant is broken: with a line that says which, so
// that a report names more than a stack. Also the processor time that an input took, for targets
// whose invariant is a bound of it.
#pragma once

#include <ctime>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "interneuron/time.h"

namespace interneuron::fuzz {

[[noreturn]] inline void finding(const std::string& what) {
  std::fprintf(stderr, "finding: %s\n", what.c_str());
  std::abort();
}

inline void require(bool holds, const char* what) {
  if (!holds) finding(what);
}

// Processor time of this process, which does not count what others on the machine do.
class ProcessorTime {
 public:
  Duration since() const { return read() - began_; }
  // Ends the program where more time has gone by since this object was made.
  void require_at_most(Duration most, const char* what) const {
    if (const Duration used = since(); used > most) {
      finding(std::string(what) + ": " + std::to_string(to_ms(used)) +
              " ms of processor time, of " + std::to_string(to_ms(most)));
    }
  }

 private:
  static Duration read() {
    timespec now{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec);
  }
  Duration began_ = read();
};

}  // namespace interneuron::fuzz
