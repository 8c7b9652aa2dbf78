// The time of day, ns since 1970, as far as a host knows it: what was said at the beginning or by a
// host that we connected to, and never less than what was said here, so that handshakes say times
// that only grow. A host that is believed may say any time; none above kLatestBelievedNs counts.
// Pure; thread-compatible.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/secure/handshake.h"
#include "interneuron/time.h"

namespace interneuron::crypto {

class TimeOfDay {
 public:
  // The latest time that is believed, which is in the year 2097: who says a later one cannot keep a
  // host that believed it from being heard before kLatestUnixNs.
  static constexpr std::int64_t kLatestBelievedNs = kLatestUnixNs - (std::int64_t{1} << 59U);

  TimeOfDay(TimePoint now, std::int64_t unix_ns) : started_(now), at_start_ns_(unix_ns) {}

  // Keep it for the next start.
  std::int64_t unix_ns(TimePoint now) const { return std::max(said_ns_, reckoned_ns(now)); }
  // The host's clock says so. Counts where it is later.
  void raise_unix_ns(TimePoint now, std::int64_t unix_ns) {
    const std::int64_t behind = std::min(unix_ns, kLatestBelievedNs) - reckoned_ns(now);
    if (behind > 0) at_start_ns_ += behind;
  }
  // What is said next: it grows with every call, also where the clock does not.
  std::int64_t next_unix_ns(TimePoint now) {
    said_ns_ = std::max(said_ns_ + 1, unix_ns(now));
    return said_ns_;
  }

 private:
  std::int64_t reckoned_ns(TimePoint now) const {
    return at_start_ns_ + Duration(now - started_).count();
  }

  TimePoint started_;
  std::int64_t at_start_ns_;
  std::int64_t said_ns_ = 0;
};

}  // namespace interneuron::crypto
