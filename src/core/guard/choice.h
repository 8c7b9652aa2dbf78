// How GuardKind::kBudget weighs its choices (levels, holds, modes of transmission): what an answer
// is worth, and how fast computations run at present. Used by BudgetObserver and BudgetOrigin, so
// that both weigh alike. Nothing is allocated. Pure; thread-compatible.
#pragma once

#include <span>
#include <utility>

#include "core/guard/recent.h"
#include "core/guard/residual_law.h"
#include "core/guard/stage_guard.h"

namespace interneuron::guard {

// Levels from this one on are never taken; it bounds what one choice costs.
inline constexpr std::size_t kMaxLevels = 16;
// Rounds are alike if what they had lost differs by no more than D_N / kAlike: 2 ms of 130 ms.
inline constexpr int kAlike = 64;
// ResidualLaw::set_scale() as a fraction of the deadline: 22 ms of 130 ms.
inline constexpr int kTail = 6;

// Copies of the same variant have a key in common: those that were the best of their message, and
// those that a better one went with.
constexpr std::uint8_t key_of(std::size_t variant, std::size_t best) {
  return static_cast<std::uint8_t>(variant % kMaxVariants + (variant == best ? kMaxVariants : 0));
}

// The quality of a level's result on a variant of the input; a level that does not tell its quality
// counts by its rank. `level` < levels.size().
double quality_of(std::span<const LevelProfile> levels, std::size_t level, std::uint8_t variant);

// How much longer (or shorter) computations take at present than the medians of their levels say,
// by the last runs. A level that ran often enough among them is judged by its own runs, any other
// one by all: what slows the node is learnt by whichever level runs, and a level that was fast
// before is not believed to be fast still. Runs are forgotten after 10 s, so that no level stays
// avoided for ever.
class Speed {
 public:
  // A computation of this level took `took`. Values that no computation can have are ignored.
  void add(TimePoint now, std::size_t level, Duration median, Duration took);
  // The run time to be expected of a level with this median.
  Duration expected(TimePoint now, std::size_t level, Duration median) const;

 private:
  // By level, in millionths of its median.
  VeryRecent ratios_;
};

// The best level for a computation on this variant, and what the round is then worth: a round on
// time brings the quality of its result, any other the local answer less the price of a miss.
// `left`: what is left for the computation and for what it and the rest of the round may lose.
std::pair<std::size_t, double> best_level(std::span<const LevelProfile> levels,
                                          std::uint8_t variant, const ResidualLaw::Near& law,
                                          const Speed& speed, TimePoint now, Duration left,
                                          const Terms& terms);

}  // namespace interneuron::guard
