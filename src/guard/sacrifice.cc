#include "interneuron/guard.h"

namespace interneuron {

std::string_view to_string(GuardKind kind) {
  return kind == GuardKind::kBudget ? "budget" : "paper";
}

std::size_t sacrificed_level(std::span<const Duration> runtimes, std::size_t chosen,
                             const Verdict& verdict) {
  if (!verdict.late || chosen == 0 || runtimes.empty()) return chosen;
  if (verdict.overrun == kFullSeverity) return 0;
  const Duration affordable = runtimes[chosen] - verdict.overrun;
  for (std::size_t level = chosen; level-- > 0;) {
    if (runtimes[level] <= affordable) return level;
  }
  return 0;
}

}  // namespace interneuron
