// The minimum of the last 10 s in ten buckets of one second, so that it costs constant time and
// memory: a value leaves between 9 and 10 s after it came (two buckets of 5 s would forget between
// 5 and 10 s). Values may be differences of clocks of two hosts: they are compared by wrapping
// subtraction. Pure; thread-compatible.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "interneuron/time.h"

namespace interneuron::link {

class WindowedMinimum {
 public:
  void add(TimePoint now, std::int64_t value);
  // The smallest value of the window; nothing when no value came within it.
  std::optional<std::int64_t> get(TimePoint now) const;
  void reset() { *this = {}; }

 private:
  static constexpr std::int64_t kBuckets = 10;
  struct Bucket {
    std::int64_t second = INT64_MIN;
    std::int64_t minimum = 0;
  };
  std::array<Bucket, kBuckets> buckets_{};
};

}  // namespace interneuron::link
