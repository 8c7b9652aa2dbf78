// Reference times of one pipeline at one node (docs/paper.md, "Reference times"): the elapsed time
// θ per round and stage is remembered until the indicator tells that the round ended on time, and
// is then folded into the base of the stage. A round that was missed or never decided leaves no
// trace.
//
// θ and base contain the clock offset, and nothing here depends on its value. They come from t0 of
// headers, which may be any 64-bit value: all arithmetic wraps. The memory is constant; a straggler
// of an old round is not recorded. Pure; thread-compatible.
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

  // Stage `stage` (1 … kMaxStages, here and below) of a round ended after θ. Nothing is recorded
  // for rounds that are settled.
  void observe(RoundId round, std::size_t stage, Duration theta);
  // The round was decided. Only the first call for a round counts.
  void settle(TimePoint now, RoundId round, RoundState state);

  // base_n. Nothing before the first round on time, and after kForget without one.
  std::optional<Duration> base(TimePoint now, std::size_t stage);

  void reset();

 private:
  struct Entry {
    bool settled = false;
    // Element [i] is the time at which stage i + 1 ended, since the round began, if bit i is set.
    std::uint16_t known = 0;
    std::array<Duration, kMaxStages> theta{};
  };
  static_assert(kMaxStages <= 16);

  RoundRing<Entry> rounds_;
  // Element [i] belongs to stage i + 1.
  std::array<std::optional<Duration>, kMaxStages> base_{};
  // When a base changed last.
  std::optional<TimePoint> accepted_at_;
};

// The next base: theta + k * (base - theta), rounded to the nearest ns.
Duration smoothed(Duration base, Duration theta);

}  // namespace interneuron::guard
