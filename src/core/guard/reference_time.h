// Reference times of one pipeline at one node (docs/paper.md, "Reference times"): θ per round and
// stage, kept until the indicator tells that the round ended on time, then folded into the stage's
// base. A missed or never decided round leaves no trace.
//
// θ and base contain the clock offset; nothing here depends on its value. Pure; thread-compatible;
// bounded.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/base/round_ring.h"
#include "interneuron/pipeline.h"
#include "interneuron/time.h"

namespace interneuron::guard {

class ReferenceTime {
 public:
  // k, the weight of the old base, in 1/1000; the paper's evaluation has 0.3.
  static constexpr std::int64_t kSmoothingPermille = 300;
  // Bases are dropped after so long without a new history (docs/paper.md, "Clock steps").
  static constexpr Duration kForget = std::chrono::seconds(60);

  // Stage numbers are 1 … kMaxStages throughout.
  void observe(RoundId round, std::size_t stage, Duration theta);
  // Applies what the header of `current` tells of the rounds before, each once, oldest first.
  void learn(TimePoint now, RoundId current, const Indicator& indicator);
  void settle(TimePoint now, RoundId round, RoundState state);

  // base_n, unless there is none (yet, or any more).
  std::optional<Duration> base(TimePoint now, std::size_t stage);

  void reset();

 private:
  struct Entry {
    bool settled = false;
    std::array<std::optional<Duration>, kMaxStages> theta{};
  };

  RoundRing<Entry> rounds_;
  std::array<std::optional<Duration>, kMaxStages> base_{};
  std::optional<TimePoint> accepted_at_;
};

// base + k·(own - base) in the paper's direction: θn + round(k·(base_n - θn)).
Duration smoothed(Duration base, Duration theta);

}  // namespace interneuron::guard
