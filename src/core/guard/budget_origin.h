// GuardKind::kBudget at the origin: sends the first transmission in the mode (whole or degraded)
// that maximises the expected quality of the answer, in which a miss costs its price.
//
// Both modes are weighed alike: by the forecast of the links, by what forecasts of this variant and
// mode erred by in the last 10 s (or all forecasts, where it was not tried), and by the law of what
// rounds lose against both. So a wrong estimate does not rule a mode out for ever. 20 KB; nothing
// is allocated after construction. As RoundGuard in all else.
#pragma once

#include "core/base/round_ring.h"
#include "core/guard/choice.h"
#include "core/guard/residual_law.h"
#include "core/guard/round_guard.h"

namespace interneuron::guard {

class BudgetOrigin final : public RoundGuard {
 public:
  explicit BudgetOrigin(const PipelineConfig& config);

  Sent begin(std::optional<Duration>, Duration) override { return {}; }
  bool weighs() const override { return true; }
  bool choose_degraded(TimePoint now, RoundId round, const Sent& sent, Duration since,
                       const Forecast& normal, const Forecast& degraded) override;
  void result(TimePoint now, RoundId round, Duration e2e, const Spent& spent) override;
  void on_time(const Sent&) override {}
  void missed(TimePoint now, RoundId round) override;

  // The expected quality of a round in this mode, less what misses cost, for tests and tools.
  // Nothing where there is no forecast.
  std::optional<double> worth_of(TimePoint now, bool degraded, Duration since,
                                 const Forecast& forecast) const;

 private:
  // A round whose first transmission has left, with the forecast of the mode it left in from t0 on.
  struct Entry {
    bool known = false;  // the end-to-end time was learnt
    bool degraded = false;
    Forecast forecast{};
  };

  // What forecasts of this variant and mode err by.
  Duration error(TimePoint now, std::uint8_t key) const;

  Duration deadline_;
  Terms terms_;
  // Where none are configured, one level, with the run time that results tell of.
  bool learns_level_;
  std::vector<LevelProfile> levels_;
  ResidualLaw law_;
  Speed speed_;
  Recent computed_;
  RoundRing<Entry> sent_;
};

}  // namespace interneuron::guard
