// GuardKind::kPaper at an observing node: records θn, derives Dn and judges (docs/paper.md, "Stage
// deadlines"). Pure; thread-compatible; bounded.
#pragma once

#include <cstdint>
#include <optional>

#include "core/guard/reference_time.h"
#include "core/guard/stage_guard.h"

namespace interneuron::guard {

class PaperObserver final : public StageGuard {
 public:
  explicit PaperObserver(bool at_origin = false) : at_origin_(at_origin) {}

  void learn(TimePoint now, RoundId current, const Indicator& indicator,
             const RecentE2e&) override {
    times_.learn(now, current, indicator);
  }
  void settle(TimePoint now, RoundId round, RoundState state, E2e = {}) override {
    times_.settle(now, round, state);
  }
  std::optional<Duration> base(TimePoint now, std::size_t stage) override {
    return times_.base(now, stage);
  }

  // Stage deadline D_n as θ (it contains the offset, like θ): base_n + X·b_n. Nothing without base
  // or clock.
  std::optional<Duration> stage_deadline(TimePoint now, const StageEnd& end,
                                         const std::optional<ClockView>& clock);

  Hold hold(TimePoint now, const StageEnd& end, const std::optional<ClockView>& clock,
            bool last_stage) override;
  Verdict end_stage(TimePoint now, const StageEnd& end,
                    const std::optional<ClockView>& clock) override;
  Verdict end_stage_held(const StageEnd& end, const Hold& hold) override;
  // The level that takes the place of `top` by the verdict (docs/paper.md, "Sacrifice").
  LevelChoice begin_computation(TimePoint now, const StageEnd& end,
                                std::span<const LevelProfile> levels, std::size_t top,
                                const Verdict& verdict) override;

  void reset() override { times_.reset(); }

 private:
  bool at_origin_;
  ReferenceTime times_;
};

}  // namespace interneuron::guard
