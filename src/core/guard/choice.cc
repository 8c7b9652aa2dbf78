#include "core/guard/choice.h"

#include <algorithm>

namespace interneuron::guard {
namespace {

constexpr std::int64_t kRatioOne = 1'000'000;
// A run is not believed to have taken more than a thousand times its median; it bounds the product.
constexpr std::int64_t kSlowest = 1000;
// Fewer runs than this say nothing of the node: a median of three leaves one accident out.
constexpr std::size_t kLeastRuns = 3;
// Fewer runs of a level than this say nothing of that level alone.
constexpr std::size_t kOwnRuns = 6;

}  // namespace

double quality_of(std::span<const LevelProfile> levels, std::size_t level, std::uint8_t variant) {
  const std::vector<double>& q = levels[level].quality;
  if (q.empty()) return static_cast<double>(level + 1) / static_cast<double>(levels.size());
  return q[std::min<std::size_t>(variant, q.size() - 1)];
}

void Speed::add(TimePoint now, std::size_t level, Duration median, Duration took) {
  if (level >= kMaxLevels || median <= Duration::zero() || took < Duration::zero()) return;
  const double ratio = static_cast<double>(took.count()) / static_cast<double>(median.count());
  ratios_.add(now, static_cast<std::uint8_t>(level),
              static_cast<std::int64_t>(std::min<double>(ratio, kSlowest) * kRatioOne));
}

Duration Speed::expected(TimePoint now, std::size_t level, Duration median) const {
  auto ratio = ratios_.median(now, static_cast<std::uint8_t>(level), kOwnRuns);
  if (!ratio) ratio = ratios_.median_of_all(now, kLeastRuns);
  const double times = static_cast<double>(ratio.value_or(kRatioOne)) / kRatioOne;
  return Duration{static_cast<std::int64_t>(static_cast<double>(median.count()) * times)};
}

std::pair<std::size_t, double> best_level(std::span<const LevelProfile> levels,
                                          std::uint8_t variant, const ResidualLaw::Near& law,
                                          const Speed& speed, TimePoint now, Duration left,
                                          const Terms& terms) {
  const double missed = terms.local_quality - terms.miss_price;
  std::pair<std::size_t, double> best{0, missed};
  for (std::size_t level = 0; level < std::min(levels.size(), kMaxLevels); ++level) {
    const double p = law.within(left - speed.expected(now, level, levels[level].median));
    const double value = p * quality_of(levels, level, variant) + (1.0 - p) * missed;
    if (value > best.second) best = {level, value};
  }
  return best;
}

}  // namespace interneuron::guard
