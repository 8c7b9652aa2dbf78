#include "core/cc/aggregation.h"

#include <algorithm>

namespace interneuron::cc {
namespace {

// What arrives at once is no more than this of the rate: grants are no further apart
// (src/core/flow/path_receiver.cc).
constexpr Duration kMostAhead = std::chrono::milliseconds(60);
// The mean is that of so many times or some. No measurement behind this value.
constexpr int kTimes = 8;

}  // namespace

void Aggregation::arrived(TimePoint now, std::size_t bytes, DataRate capacity) {
  if (bytes == 0 || capacity <= DataRate{}) return;
  const double per_second = static_cast<double>(capacity.bits_per_second) / 8;
  if (!since_ || bytes_ <= per_second * to_seconds(now - *since_)) {
    mean_ += (most_ - mean_) / kTimes;
    most_ = {};
    since_ = now;
    bytes_ = 0;
  }
  bytes_ += static_cast<double>(bytes);
  const double ahead = bytes_ / per_second - to_seconds(now - *since_);
  const double seconds = std::clamp(ahead, 0.0, to_seconds(kMostAhead));
  most_ = std::max(most_, Duration{static_cast<std::int64_t>(seconds * 1e9)});
}

}  // namespace interneuron::cc
