#include "core/guard/choice.h"

#include <algorithm>

namespace interneuron::guard {

double quality_of(std::span<const LevelProfile> levels, std::size_t level, std::uint8_t variant) {
  const std::vector<double>& q = levels[level].quality;
  if (q.empty()) return static_cast<double>(level + 1) / static_cast<double>(levels.size());
  return q[std::min<std::size_t>(variant, q.size() - 1)];
}

std::optional<double> Speed::median(TimePoint now, std::optional<std::size_t> level,
                                    std::size_t least) const {
  std::array<double, kRuns> ratios;
  std::size_t count = 0;
  for (std::size_t i = 0; i < used_; ++i) {
    const Run& run = runs_[i];
    if (now - run.at <= kRecent && level.value_or(run.level) == run.level) {
      ratios[count++] = run.ratio;
    }
  }
  if (count < least) return std::nullopt;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>((count - 1) / 2);
  std::nth_element(ratios.begin(), middle, ratios.begin() + static_cast<std::ptrdiff_t>(count));
  return *middle;
}

void Speed::add(TimePoint now, std::size_t level, Duration median_of_level, Duration computed) {
  if (level >= kMaxLevels || median_of_level <= Duration::zero() || computed < Duration::zero()) {
    return;
  }
  runs_[next_] = {
      now, level,
      static_cast<double>(computed.count()) / static_cast<double>(median_of_level.count())};
  next_ = (next_ + 1) % kRuns;
  used_ = std::min(used_ + 1, kRuns);
  factor_.fill(median(now, std::nullopt, kLeast).value_or(1.0));
  for (std::size_t i = 0; i < used_; ++i) {
    const std::size_t own = runs_[i].level;
    if (const auto factor = median(now, own, kOwn)) factor_[own] = *factor;
  }
}

}  // namespace interneuron::guard
