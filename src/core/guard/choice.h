// What a choice is worth to GuardKind::kBudget. Pure.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <utility>

#include "core/guard/recent.h"
#include "core/guard/residual_law.h"
#include "core/guard/stage_guard.h"

namespace interneuron::guard {

// Levels beyond are never chosen; chosen.
inline constexpr std::size_t kMaxLevels = 16;

struct Worth {
  Chance on_time{};
  double value = 0;  // expected quality, less what misses cost
};

inline Worth worth(const Chance& on_time, double quality, const Terms& terms) {
  const double p = on_time.hedged;
  return {on_time, p * quality + (1.0 - p) * (terms.local_quality - terms.miss_price)};
}

inline bool keeps(const Worth& w, double target) { return w.on_time.least >= target; }
inline bool misses(const Worth& w, double target) { return w.on_time.most < target; }

// The choice of the highest value; where it is known to miss the target, the highest value of those
// that are known to keep it, if there are any. (While too little is known to tell, the value
// decides, in which every miss has its price: a target that nothing can be shown to keep would
// condemn every choice but the cheapest until hundreds of rounds are known.)
template <class Id>
class Best {
 public:
  explicit Best(double target) : target_(target) {}
  void consider(const Id& id, const Worth& w) {
    if (!any_ || better(w, any_->second)) any_ = {id, w};
    if (keeps(w, target_) && (!kept_ || better(w, kept_->second))) kept_ = {id, w};
  }
  // Nothing was considered: nothing.
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
// "Sacrifice"). `levels`: from the lowest
// quality to the highest; `top`: the level that would be taken otherwise. When the stage was late:
// the best level at least one step below `top` whose median run time makes up for the overrun,
// R[level] <= R[top] - overrun; where none is so short, the lowest.
std::size_t sacrificed_level(std::span<const LevelProfile> levels, std::size_t top,
                             const Verdict& verdict);

// The quality of a level's result on a variant; a level that says nothing counts by its rank.
double quality_of(std::span<const LevelProfile> levels, std::size_t level, std::uint8_t variant);

// How much longer (or shorter) levels take than their medians say, by the last kRuns runs of the
// last 10 s. A level that ran often enough among them is judged by its own runs, any other by all:
// what slows the node is learnt by whichever level runs, and a level that was fast before is not
// believed to be fast still. Forgotten after 10 s, so that nothing stays condemned.
class Speed {
 public:
  void add(TimePoint now, std::size_t level, Duration median_of_level, Duration computed);
  Duration expected(std::size_t level, Duration median) const {
    return Duration{static_cast<std::int64_t>(static_cast<double>(median.count()) *
                                              factor_[level < kMaxLevels ? level : 0])};
  }

 private:
  static constexpr std::size_t kRuns = 16;  // chosen
  static constexpr std::size_t kLeast = 3;  // of all, that say something; chosen
  static constexpr std::size_t kOwn = 6;    // of a level, that say something of it; chosen
  struct Run {
    TimePoint at{};
    std::size_t level = 0;
    double ratio = 0;  // computed / median
  };
  // The lower median of the runs of a level, or of all; nothing when they are fewer than `least`.
  std::optional<double> median(TimePoint now, std::optional<std::size_t> level,
                               std::size_t least) const;

  std::array<Run, kRuns> runs_{};
  std::size_t used_ = 0;
  std::size_t next_ = 0;
  std::array<double, kMaxLevels> factor_ = filled();

  static constexpr std::array<double, kMaxLevels> filled() {
    std::array<double, kMaxLevels> out{};
    for (double& f : out) f = 1.0;
    return out;
  }
};

}  // namespace interneuron::guard
