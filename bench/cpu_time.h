// The clock of the programs that measure what a piece of work costs.
#pragma once

#include <time.h>

namespace interneuron::bench {

// What this thread has had of a processor so far, in microseconds; time in which others have it
// does not count.
inline double thread_us() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e6 + static_cast<double>(t.tv_nsec) / 1e3;
}

}  // namespace interneuron::bench
