#include "node/io/steady_clock.h"

#include <sys/prctl.h>
#include <time.h>

namespace interneuron::io {

TimePoint now() {
  timespec t{};
  // Cannot fail: the clock exists and &t is valid.
  clock_gettime(CLOCK_MONOTONIC, &t);
  return TimePoint{std::chrono::seconds{t.tv_sec} + Duration{t.tv_nsec}};
}

std::int64_t unix_time_ns() {
  timespec t{};
  clock_gettime(CLOCK_REALTIME, &t);
  return Duration{std::chrono::seconds{t.tv_sec} + Duration{t.tv_nsec}}.count();
}

// A thread that loses the CPU between two readings would be wrong by milliseconds, so the attempt
// with the least time between its readings of CLOCK_MONOTONIC counts.
Duration wall_offset() {
  // Three readings take 0.1 us; with this much between the outer two they were interrupted, and
  // another attempt is made.
  constexpr Duration kTight = std::chrono::microseconds(2);
  constexpr int kAttempts = 10;
  Duration best{};
  Duration tightest = Duration::max();
  for (int i = 0; i < kAttempts && tightest > kTight; ++i) {
    const TimePoint before = now();
    const Duration wall{unix_time_ns()};
    const Duration gap = now() - before;
    if (gap >= tightest) continue;
    tightest = gap;
    best = wall - before.time_since_epoch() - gap / 2;
  }
  return best;
}

TimePoint instant_of_stamp(Duration stamp, TimePoint now, Duration wall_offset) {
  const Duration age = now.time_since_epoch() + wall_offset - stamp;
  return age < Duration::zero() || age > std::chrono::seconds(10) ? now : now - age;
}

PreciseTimers::PreciseTimers() : previous_ns_(prctl(PR_GET_TIMERSLACK)) {
  prctl(PR_SET_TIMERSLACK, 1UL);
}

PreciseTimers::~PreciseTimers() {
  if (previous_ns_ > 0) prctl(PR_SET_TIMERSLACK, static_cast<unsigned long>(previous_ns_));
}

}  // namespace interneuron::io
