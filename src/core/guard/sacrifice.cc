#include "core/guard/choice.h"

namespace interneuron {

std::string_view to_string(GuardKind kind) {
  return kind == GuardKind::kBudget ? "budget" : "paper";
}

namespace {

template <class Runtime>
std::size_t sacrificed(std::size_t levels, std::size_t chosen, const Verdict& verdict,
                       const Runtime& runtime) {
  if (!verdict.late || chosen == 0 || levels == 0) return chosen;
  if (verdict.overrun == kFullSeverity) return 0;
  const Duration affordable = runtime(chosen) - verdict.overrun;
  for (std::size_t level = chosen; level-- > 0;) {
    if (runtime(level) <= affordable) return level;
  }
  return 0;
}

}  // namespace

std::size_t sacrificed_level(std::span<const Duration> runtimes, std::size_t chosen,
                             const Verdict& verdict) {
  return sacrificed(runtimes.size(), chosen, verdict, [&](std::size_t l) { return runtimes[l]; });
}

std::size_t guard::sacrificed_level(std::span<const LevelProfile> levels, std::size_t chosen,
                                    const Verdict& verdict) {
  return sacrificed(levels.size(), chosen, verdict,
                    [&](std::size_t l) { return levels[l].median; });
}

}  // namespace interneuron
