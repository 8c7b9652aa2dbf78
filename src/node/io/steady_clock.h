// The one place where the library reads a clock; everything else is told the time.
#pragma once

#include <cstdint>

#include "interneuron/time.h"

namespace interneuron::io {

// CLOCK_MONOTONIC, the same clock as std::chrono::steady_clock of libstdc++ and libc++ on Linux.
// Thread-safe.
TimePoint now();

// CLOCK_REALTIME minus CLOCK_MONOTONIC, as they are at the moment: for times on the wire that
// others read as the time of day, and for the kernel's stamps. Nothing is decided by it.
// Thread-safe.
Duration wall_offset();

// CLOCK_REALTIME in ns since 1970, which may be wrong and may go back. Thread-safe.
std::int64_t unix_time_ns();

// When something happened that the kernel has stamped with CLOCK_REALTIME so long ago; `now`, and
// what wall_offset() was then. Only the age of the stamp counts, so that a step of that clock
// spoils few instants: `now` stands for a stamp from the future or of more than 10 s ago.
TimePoint instant_of_stamp(Duration stamp, TimePoint now, Duration wall_offset);

// While it lives, timers of the calling thread fire at most 1 ns late by the kernel's choice
// instead of the default 50 us (man 2 prctl, PR_SET_TIMERSLACK). Create and destroy it on the same
// thread.
class PreciseTimers {
 public:
  PreciseTimers();
  ~PreciseTimers();
  PreciseTimers(const PreciseTimers&) = delete;
  PreciseTimers& operator=(const PreciseTimers&) = delete;

 private:
  int previous_ns_;
};

}  // namespace interneuron::io
