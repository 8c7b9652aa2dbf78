#include "core/link/estimators.h"

#include <algorithm>

namespace interneuron::link {
namespace {

// A longer queue counts as this long: it comes from a lying peer or a clock that stepped, and sums
// of it must stay in range.
constexpr Duration kLongest = std::chrono::minutes(1);
// What each new sample adds of its difference, as a divisor. No measurement behind this value: one
// late packet should not look like a queue, and a queue should show within a few packets.
constexpr int kSmoothingDivisor = 4;

}  // namespace

void QueueSignal::add(TimePoint now, Duration one_way) {
  minimum_.add(now, one_way.count());
  const Duration above = std::clamp(Duration{wrapping_sub(one_way.count(), *minimum_.get(now))},
                                    Duration::zero(), kLongest);
  smoothed_ =
      any_ && now - at_ <= kFresh ? smoothed_ + (above - smoothed_) / kSmoothingDivisor : above;
  any_ = true;
  at_ = now;
}

Duration QueueSignal::queue(TimePoint now) const {
  return any_ && now - at_ <= kFresh ? smoothed_ : Duration::zero();
}

Duration QueueSignal::left(TimePoint now) const {
  return any_ ? std::max<Duration>(queue(now) - (now - at_), Duration::zero()) : Duration::zero();
}

}  // namespace interneuron::link
