#include "lab/emu/queue_time.h"

#include <algorithm>
#include <chrono>

namespace interneuron::emu {

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
