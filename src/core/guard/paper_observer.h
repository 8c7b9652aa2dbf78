// GuardKind::kPaper at an observing node, the paper's rule (docs/paper.md, "Stage deadlines", and
// "Sacrifice" for the one thing that is added to it): compares the elapsed time θ of a stage with a
// deadline that is derived from the reference times of rounds before and from the tolerance X of
// the header. What is late makes the next module cheaper. As StageGuard in all else.
#pragma once

#include <cstdint>
#include <optional>

#include "core/guard/reference_time.h"
#include "core/guard/stage_guard.h"

namespace interneuron::guard {

class PaperObserver final : public StageGuard {
 public:
  explicit PaperObserver(bool at_origin = false, const Ablation& ablation = {})
      : at_origin_(at_origin), ablation_(ablation) {}

  void settle(TimePoint now, RoundId round, RoundState state, E2e = {}) override {
    times_.settle(now, round, state);
  }
  std::optional<Duration> base(TimePoint now, std::size_t stage) override {
    return times_.base(now, stage);
  }

  // The stage deadline D_n as an elapsed time: base_n + X * b_n. It contains the clock offset, as θ
  // does. Nothing without a base or, except at the origin, without a clock.
  std::optional<Duration> stage_deadline(TimePoint now, const StageEnd& end,
                                         const std::optional<ClockView>& clock);

  // Until D_n; without one, for a quarter of the end-to-end deadline.
  Hold hold(TimePoint now, const StageEnd& end, const std::optional<ClockView>& clock,
            bool last_stage) override;
  // Late where θ exceeds D_n. Without a D_n: late at full severity where X < 0, else not.
  Verdict end_stage(TimePoint now, const StageEnd& end,
                    const std::optional<ClockView>& clock) override;
  Verdict end_stage_held(const StageEnd& end, const Hold& hold) override;
  // sacrificed_level() of `top`, by the stage that ended as it stands now: what passed since the
  // hand-over, in a queue for example, counts too, beyond kTurn.
  LevelChoice begin_computation(TimePoint now, const StageEnd& end,
                                const std::optional<ClockView>& clock,
                                std::span<const LevelProfile> levels, std::size_t top,
                                const Verdict& verdict) override;

  void reset() override { times_.reset(); }

  // Between the hand-over of a message and the beginning of its computation there is a turn of the
  // application's loop. So little is no delay; it is far below every delay that a level can make up
  // for. No measurement behind this value.
  static constexpr Duration kTurn = std::chrono::milliseconds(1);

 private:
  void observe(const StageEnd& end, Duration theta);

  bool at_origin_;
  Ablation ablation_;
  ReferenceTime times_;
};

}  // namespace interneuron::guard
