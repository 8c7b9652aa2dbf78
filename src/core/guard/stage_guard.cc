#include "core/guard/stage_guard.h"

namespace interneuron::guard {

void StageGuard::learn(TimePoint now, RoundId current, const Indicator& indicator,
                       const RecentE2e& e2e) {
  for (std::size_t i = indicator.size(); i-- > 0;) {
    if (current.value <= i || indicator[i] == RoundState::kUnknown) continue;
    settle(now, RoundId{current.value - 1 - static_cast<std::uint32_t>(i)}, indicator[i], e2e[i]);
  }
}

std::size_t sacrificed_level(std::span<const LevelProfile> levels, std::size_t top,
                             const Verdict& verdict) {
  if (!verdict.late || top == 0 || levels.empty()) return top;
  if (verdict.overrun == kFullSeverity) return 0;
  const Duration affordable = levels[top].median - verdict.overrun;
  for (std::size_t level = top; level-- > 0;) {
    if (levels[level].median <= affordable) return level;
  }
  return 0;
}

}  // namespace interneuron::guard
