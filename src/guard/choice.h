// What a choice is worth to GuardKind::kBudget. Pure.
#pragma once

#include <array>
#include <span>

#include "guard/recent.h"
#include "guard/stage_guard.h"

namespace interneuron::guard {

// Levels beyond are never chosen; chosen.
inline constexpr std::size_t kMaxLevels = 16;

struct Worth {
  double on_time = 0;  // P(round on time)
  double value = 0;    // expected quality, less what misses cost
};

inline Worth worth(double on_time, double quality, const Terms& terms) {
  return {on_time, on_time * quality + (1.0 - on_time) * (terms.local_quality - terms.miss_price)};
}

// Those that keep the target come before those that do not, then the value decides, then P.
inline bool better(const Worth& a, const Worth& b, double target) {
  if ((a.on_time >= target) != (b.on_time >= target)) return a.on_time >= target;
  return a.value != b.value ? a.value > b.value : a.on_time > b.on_time;
}

// interneuron::sacrificed_level() by the levels' medians.
std::size_t sacrificed_level(std::span<const LevelProfile> levels, std::size_t chosen,
                             const Verdict& verdict);

// The quality of a level's result on a variant; a level that says nothing counts by its rank.
double quality_of(std::span<const LevelProfile> levels, std::size_t level, std::uint8_t variant);

// How much longer (or shorter) levels take than their medians say. What slows all of them is learnt
// by whichever runs; what slows one of them by its own runs, and is forgotten after 10 s, so that a
// level which is not tried does not stay condemned.
class Speed {
 public:
  void add(TimePoint now, std::size_t level, Duration median, Duration computed);
  Duration expected(std::size_t level, Duration median) const {
    return Duration{static_cast<std::int64_t>(static_cast<double>(median.count()) *
                                              factor_[level < kMaxLevels ? level : 0])};
  }

 private:
  static constexpr std::size_t kLeast = 3;  // runs that say something; chosen
  Recent ratios_;                           // computed / median in 1/1,000,000
  std::array<double, kMaxLevels> factor_ = filled();

  static constexpr std::array<double, kMaxLevels> filled() {
    std::array<double, kMaxLevels> out{};
    for (double& f : out) f = 1.0;
    return out;
  }
};

}  // namespace interneuron::guard
