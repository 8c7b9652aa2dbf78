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

Duration wall_offset() { return Duration{unix_time_ns()} - now().time_since_epoch(); }

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
