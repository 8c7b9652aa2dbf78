// How GuardKind::kBudget weighs its choices (levels, holds, modes of transmission): the worth of a
// choice, the best of several, and how fast computations run at present. Used by BudgetObserver and
// BudgetOrigin, so that both weigh alike. Nothing is allocated. Pure; thread-compatible.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <utility>

#include "core/guard/recent.h"
#include "core/guard/residual_law.h"
#include "core/guard/stage_guard.h"

namespace interneuron::guard {

// Levels from this one on are never taken; it bounds what one choice costs.
inline constexpr std::size_t kMaxLevels = 16;
// Rounds are alike when what they had lost differs by less than this fraction of the deadline: 8 ms
// of 130 ms.
inline constexpr int kAlike = 16;
// The scale of the smoothing tail (ResidualLaw::set_scale) as a fraction of the deadline: 22 ms of
// 130 ms.
inline constexpr int kTail = 6;

struct Worth {
  // The probability that the round is on time.
  Chance on_time{};
  // The expected quality of the answer, less what misses cost.
  double value = 0;
};

// A round on time brings `quality`; any other brings the local answer and costs the price of a
// miss.
inline Worth worth(const Chance& on_time, double quality, const Terms& terms) {
  const double p = on_time.hedged;
  return {on_time, p * quality + (1.0 - p) * (terms.local_quality - terms.miss_price)};
}

// Whether a choice is known to keep the target, and whether it is known to miss it. Neither is true
// while too few rounds were seen.
inline bool keeps(const Worth& w, double target) { return w.on_time.least >= target; }
inline bool misses(const Worth& w, double target) { return w.on_time.most < target; }

// The best of the choices considered: the one of the highest value; but where that one is known to
// miss the target, the one of the highest value among those that are known to keep it, if there are
// any. While too little is known to tell, the value decides, in which every miss has its price: a
// target that nothing can be shown to keep would leave only the cheapest choice until hundreds of
// rounds are known.
template <class Id>
class Best {
 public:
  explicit Best(double target) : target_(target) {}
  void consider(const Id& id, const Worth& w) {
    if (!any_ || better(w, any_->second)) any_ = {id, w};
    if (keeps(w, target_) && (!kept_ || better(w, kept_->second))) kept_ = {id, w};
  }
  // Empty until consider() is called.
  const std::optional<std::pair<Id, Worth>>& get() const {
    return kept_ && misses(any_->second, target_) ? kept_ : any_;
  }

 private:
  static bool better(const Worth& a, const Worth& b) {
    return a.value != b.value ? a.value > b.value : a.on_time.hedged > b.on_time.hedged;
  }
  double target_;
  std::optional<std::pair<Id, Worth>> any_;
  std::optional<std::pair<Id, Worth>> kept_;
};

// The level of a computation after a stage that ended with this verdict (docs/paper.md,
// "Sacrifice"). `levels`: from the lowest quality to the highest; `top`: the level that would be
// taken otherwise. When the stage was late: the best level at least one step below `top` whose
// median run time makes up for the overrun, R[level] <= R[top] - overrun; where none is so short,
// the lowest.
std::size_t sacrificed_level(std::span<const LevelProfile> levels, std::size_t top,
                             const Verdict& verdict);

// The quality of a level's result on a variant of the input; a level that does not tell its quality
// counts by its rank. `level` < levels.size().
double quality_of(std::span<const LevelProfile> levels, std::size_t level, std::uint8_t variant);

// How much longer (or shorter) computations take at present than the medians of their levels say,
// by the last kRuns runs of the last 10 s. A level that ran often enough among them is judged by
// its own runs, any other one by all: what slows the node is learnt by whichever level runs, and a
// level that was fast before is not believed to be fast still. Runs are forgotten after 10 s, so
// that no level stays avoided for ever.
class Speed {
 public:
  // A computation of this level took `computed`. Values that no computation can have are ignored.
  void add(TimePoint now, std::size_t level, Duration median_of_level, Duration computed);
  // The run time to be expected of a level with this median.
  Duration expected(std::size_t level, Duration median) const {
    return Duration{static_cast<std::int64_t>(static_cast<double>(median.count()) *
                                              factor_[level < kMaxLevels ? level : 0])};
  }

 private:
  // 1.6 s at 10 rounds per second: a node that becomes slower is known within a second.
  static constexpr std::size_t kRuns = 16;
  // Fewer runs than this say nothing of the node: a median of three leaves one accident out.
  static constexpr std::size_t kLeast = 3;
  // Fewer runs of a level than this say nothing of that level alone.
  static constexpr std::size_t kOwn = 6;

  struct Run {
    TimePoint at{};
    std::size_t level = 0;
    // The run time as a multiple of the level's median.
    double ratio = 0;
  };
  // The lower median of the ratios of one level, or of all; nothing where they are fewer than
  // `least`.
  std::optional<double> median(TimePoint now, std::optional<std::size_t> level,
                               std::size_t least) const;

  static constexpr std::array<double, kMaxLevels> filled() {
    std::array<double, kMaxLevels> out{};
    for (double& f : out) f = 1.0;
    return out;
  }

  std::array<Run, kRuns> runs_{};
  std::size_t used_ = 0;
  std::size_t next_ = 0;
  // Element [l]: the factor by which level l takes longer than its profile says; 1 when as long.
  std::array<double, kMaxLevels> factor_ = filled();
};

}  // namespace interneuron::guard
