#include "guard/choice.h"

#include <algorithm>

namespace interneuron::guard {
namespace {

constexpr std::int64_t kUnit = 1'000'000;

}  // namespace

double quality_of(std::span<const LevelProfile> levels, std::size_t level, std::uint8_t variant) {
  const std::vector<double>& q = levels[level].quality;
  if (q.empty()) return static_cast<double>(level + 1) / static_cast<double>(levels.size());
  return q[std::min<std::size_t>(variant, q.size() - 1)];
}

void Speed::add(TimePoint now, std::size_t level, Duration median, Duration computed) {
  if (level >= kMaxLevels || median <= Duration::zero() || computed < Duration::zero()) return;
  const double ratio = static_cast<double>(computed.count()) / static_cast<double>(median.count());
  ratios_.add(now, static_cast<std::uint8_t>(level),
              static_cast<std::int64_t>(std::min(ratio, 1e6) * static_cast<double>(kUnit)));
  const auto common = ratios_.median_of_all(now, kLeast);
  for (std::size_t l = 0; l < kMaxLevels; ++l) {
    const auto own = ratios_.median(now, static_cast<std::uint8_t>(l), kLeast);
    factor_[l] = static_cast<double>(own.value_or(common.value_or(kUnit))) / kUnit;
  }
}

}  // namespace interneuron::guard
