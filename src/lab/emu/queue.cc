#include <algorithm>
#include <chrono>
#include <cmath>

#include "lab/emu/queue.h"

namespace interneuron::emu {
namespace {

// The MTU of the link: a queue of less than one full packet is none (RFC 8289, section 5.2,
// maxpacket_).
constexpr std::size_t kLargestPacket = 1500;

// For how many intervals the rate of drops is remembered (RFC 8289, section 5.5).
constexpr int kRemembered = 16;

}  // namespace

// The RFC's ok_to_drop: packets have waited too long for a whole interval.
bool CoDel::stands(Duration now, Duration sojourn, std::size_t behind) {
  if (sojourn < params_.target || behind <= kLargestPacket) {
    drop_from_.reset();
    return false;
  }
  if (!drop_from_) drop_from_ = now + params_.interval;
  return now >= *drop_from_;
}

// The control law: the next signal after one at `t`.
Duration CoDel::after(Duration t) const {
  const double interval = static_cast<double>(params_.interval.count());
  return t + Duration{static_cast<std::int64_t>(interval / std::sqrt(count_))};
}

bool CoDel::signals(Duration now, Duration sojourn, std::size_t behind) {
  const bool standing = stands(now, sojourn, behind);
  const bool advance = advance_;
  advance_ = false;
  if (!standing) {
    dropping_ = false;
    return false;
  }
  if (!dropping_) {
    dropping_ = true;
    // If the last cycle ended only now, its rate is a good one to begin with.
    const std::uint32_t last_cycle = count_ - last_count_;
    count_ = last_cycle > 1 && now - next_ < kRemembered * params_.interval ? last_cycle : 1;
    next_ = after(now);
    last_count_ = count_;
    return true;
  }
  if (advance) next_ = after(next_);
  if (now < next_) return false;
  ++count_;
  advance_ = true;
  return true;
}

namespace {

constexpr Duration kStep = std::chrono::microseconds(100);

}  // namespace

void QueueTime::add(Duration from, Duration to, Duration gone) {
  from = std::max(from, since_);
  if (from >= to) return;
  counted_ += to - from;
  const Duration longest = gone - from;
  const Duration shortest = gone - to;
  area_ += static_cast<double>((longest + shortest).count()) / 2 *
           static_cast<double>((to - from).count());
  const auto last = static_cast<std::size_t>((longest - Duration{1}) / kStep);
  if (at_.size() <= last) at_.resize(last + 1);
  for (auto i = static_cast<std::size_t>(shortest / kStep); i <= last; ++i) {
    const Duration low = std::max(shortest, kStep * static_cast<std::int64_t>(i));
    const Duration high = std::min(longest, kStep * static_cast<std::int64_t>(i + 1));
    at_[i] += (high - low).count();
  }
}

void QueueTime::add_empty(Duration from, Duration to) {
  from = std::max(from, since_);
  if (from >= to) return;
  counted_ += to - from;
  empty_ += to - from;
}

Duration QueueTime::quantile(double share) const {
  const double wanted = share * static_cast<double>(counted_.count());
  auto passed = static_cast<double>(empty_.count());
  if (passed >= wanted) return {};
  for (std::size_t i = 0; i < at_.size(); ++i) {
    passed += static_cast<double>(at_[i]);
    if (passed >= wanted) return kStep * static_cast<std::int64_t>(i + 1);
  }
  return kStep * static_cast<std::int64_t>(at_.size());
}

Duration QueueTime::mean() const {
  if (counted_ <= Duration{}) return {};
  return Duration{static_cast<std::int64_t>(area_ / static_cast<double>(counted_.count()))};
}

}  // namespace interneuron::emu
