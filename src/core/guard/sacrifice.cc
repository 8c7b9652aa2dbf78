#include "core/guard/choice.h"

namespace interneuron {

std::string_view to_string(GuardKind kind) {
  return kind == GuardKind::kBudget ? "budget" : "paper";
}

std::size_t guard::sacrificed_level(std::span<const LevelProfile> levels, std::size_t top,
                                    const Verdict& verdict) {
  if (!verdict.late || top == 0 || levels.empty()) return top;
  if (verdict.overrun == kFullSeverity) return 0;
  const Duration affordable = levels[top].median - verdict.overrun;
  for (std::size_t level = top; level-- > 0;) {
    if (levels[level].median <= affordable) return level;
  }
  return 0;
}

}  // namespace interneuron
