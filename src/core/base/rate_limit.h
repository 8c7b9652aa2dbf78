// How often something may happen, in the long run and at once: a bucket of tokens, kept as the
// instant at which it would be full again (the generic cell rate algorithm of ATM, ITU-T I.371), so
// that a question costs an addition and a comparison.
//
// Times are arguments that never go back. Constant memory. Pure; thread-compatible.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "interneuron/time.h"

namespace interneuron {

class RateLimit {
 public:
  // `per_second`: at least 1. `burst`: what may come at once is what comes within this time.
  RateLimit(std::uint32_t per_second, Duration burst)
      : each_(std::max<Duration>(Duration{1}, Duration(std::chrono::seconds(1)) /
                                                  std::max<std::uint32_t>(per_second, 1))),
        burst_(burst) {}

  // Whether it may happen now; if so, it has.
  bool take(TimePoint now) {
    const TimePoint from = std::max(full_at_, now);
    if (from - now > burst_) return false;
    full_at_ = from + each_;
    return true;
  }

 private:
  Duration each_;
  Duration burst_;
  TimePoint full_at_ = TimePoint::min();
};

}  // namespace interneuron
