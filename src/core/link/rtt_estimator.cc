#include "core/link/estimators.h"

#include <algorithm>
#include <cmath>

namespace interneuron::link {
namespace {

// What each new sample adds of its difference, as a divisor: gains of 1/8 and 1/4 for SRTT and
// RTTVAR (RFC 6298 §2), and a quicker one to plan with.
constexpr int kSmoothedDivisor = 8;
constexpr int kVariationDivisor = 4;
constexpr int kQuickDivisor = 4;
// A key is the value in ns (44 bits: 4.8 hours) and the low bits of its sequence number.
constexpr int kSequenceBits = 20;
constexpr std::uint64_t kSequenceMask = (1U << kSequenceBits) - 1;
// A longer round trip counts as this long: only a lying peer reports it, and sums and multiples of
// it must stay in range.
constexpr Duration kLongestRtt = std::chrono::minutes(1);
static_assert(kLongestRtt.count() < std::int64_t{1} << (64 - kSequenceBits));

// Room for the first second of a path with a heartbeat every 50 ms; a power of two, as kCapacity.
constexpr std::size_t kFirstCapacity = 32;
static_assert((RttEstimator::kCapacity & (RttEstimator::kCapacity - 1)) == 0);

Duration value_of(std::uint64_t key) {
  return Duration{static_cast<std::int64_t>(key >> kSequenceBits)};
}

// The first place in [from, from + n) that is not less than `key`. Without branches: random values
// would mispredict half of them.
std::uint64_t* lower_bound(std::uint64_t* from, std::size_t n, std::uint64_t key) {
  while (n > 1) {
    const std::size_t half = n / 2;
    from += from[half - 1] < key ? half : 0;
    n -= half;
  }
  return n == 1 && *from < key ? from + 1 : from;
}

}  // namespace

void RttEstimator::add(TimePoint now, Duration rtt) {
  rtt = std::clamp(rtt, Duration::zero(), kLongestRtt);
  if (!measured()) {
    smoothed_ = quick_ = rtt;
    variation_ = rtt / 2;
  } else {
    const Duration off = rtt > smoothed_ ? rtt - smoothed_ : smoothed_ - rtt;
    variation_ += (off - variation_) / kVariationDivisor;
    smoothed_ += (rtt - smoothed_) / kSmoothedDivisor;
    quick_ += (rtt - quick_) / kQuickDivisor;
  }
  newest_ = rtt;
  minimum_.add(now, rtt.count());

  std::size_t gone = expired(now);
  if (gone == 0 && count_ == kCapacity) gone = 1;
  for (; gone > 1; --gone) {
    erase(oldest(0).key);
    pop_oldest();
  }
  if (gone == 0 && count_ == ring_.size()) grow();
  const auto value = static_cast<std::uint64_t>(rtt.count());
  const std::uint64_t key = value << kSequenceBits | (sequence_++ & kSequenceMask);
  if (gone == 1) {
    replace(oldest(0).key, key);
    pop_oldest();
  } else {
    insert(key);
  }
  slot(count_) = {now, key};
  ++count_;
}

void RttEstimator::pop_oldest() {
  first_ = (first_ + 1) & (ring_.size() - 1);
  --count_;
}

void RttEstimator::grow() {
  std::vector<Sample> larger(ring_.empty() ? kFirstCapacity : 2 * ring_.size());
  for (std::size_t i = 0; i < count_; ++i) larger[i] = oldest(i);
  ring_.swap(larger);
  sorted_.resize(ring_.size());
  first_ = 0;
}

std::size_t RttEstimator::expired(TimePoint now) const {
  std::size_t n = 0;
  while (n < count_ && oldest(n).at < now - kQuantileWindow) ++n;
  return n;
}

void RttEstimator::insert(std::uint64_t key) {
  std::uint64_t* const end = sorted_.data() + count_;
  std::uint64_t* const place = lower_bound(sorted_.data(), count_, key);
  std::copy_backward(place, end, end + 1);
  *place = key;
}

void RttEstimator::erase(std::uint64_t key) {
  std::uint64_t* const place = lower_bound(sorted_.data(), count_, key);
  std::copy(place + 1, sorted_.data() + count_, place);
}

// One move of what lies between the two places.
void RttEstimator::replace(std::uint64_t old_key, std::uint64_t key) {
  // Both searches in one loop: their loads do not wait for each other. Never empty here.
  std::uint64_t* from = sorted_.data();
  std::uint64_t* to = from;
  for (std::size_t n = count_; n > 1;) {
    const std::size_t half = n / 2;
    from += from[half - 1] < old_key ? half : 0;
    to += to[half - 1] < key ? half : 0;
    n -= half;
  }
  // The old key is still at `from`.
  to += *to < key ? 1 : 0;
  if (key > old_key) {
    std::copy(from + 1, to, from);
    *(to - 1) = key;
  } else {
    std::copy_backward(to, from, from + 1);
    *to = key;
  }
}

Duration RttEstimator::quantile(TimePoint now, double q) const {
  const std::size_t gone = expired(now);
  const std::size_t live = count_ - gone;
  if (live == 0) return newest_;
  const double wanted = std::ceil(q * static_cast<double>(live));
  std::size_t rank = static_cast<std::size_t>(std::clamp(wanted, 1.0, static_cast<double>(live)));
  if (gone == 0) return value_of(sorted_[rank - 1]);
  const std::uint64_t first = oldest(0).key & kSequenceMask;
  for (std::size_t i = 0;; ++i) {
    const bool dead = (((sorted_[i] & kSequenceMask) - first) & kSequenceMask) < gone;
    if (!dead && --rank == 0) return value_of(sorted_[i]);
  }
}

Duration RttEstimator::minimum(TimePoint now) const {
  return Duration{minimum_.get(now).value_or(newest_.count())};
}

std::size_t RttEstimator::samples(TimePoint now) const { return count_ - expired(now); }

}  // namespace interneuron::link
