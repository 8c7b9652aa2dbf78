#include "core/link/windowed_minimum.h"

namespace interneuron::link {
namespace {

std::int64_t bucket_of(TimePoint t) {
  return std::chrono::floor<std::chrono::seconds>(t.time_since_epoch()).count();
}

}  // namespace

void WindowedMinimum::add(TimePoint now, std::int64_t value) {
  const std::int64_t second = bucket_of(now);
  // The remainder is negative for times before the epoch.
  const std::int64_t place = ((second % kBuckets) + kBuckets) % kBuckets;
  Bucket& bucket = buckets_[static_cast<std::size_t>(place)];
  if (bucket.second != second) {
    bucket = {second, value};
  } else if (wrapping_sub(value, bucket.minimum) < 0) {
    bucket.minimum = value;
  }
}

std::optional<std::int64_t> WindowedMinimum::get(TimePoint now) const {
  const std::int64_t oldest = bucket_of(now) - kBuckets + 1;
  std::optional<std::int64_t> best;
  for (const Bucket& bucket : buckets_) {
    if (bucket.second < oldest) continue;
    if (!best || wrapping_sub(bucket.minimum, *best) < 0) best = bucket.minimum;
  }
  return best;
}

}  // namespace interneuron::link
