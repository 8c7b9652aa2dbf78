// GuardKind::kBudget at the origin: sends the first transmission in the mode (whole or degraded)
// that maximises the expected quality subject to P(round on time) >= target.
//
// Both modes are weighed alike: by the forecast of the links, by what forecasts of this mode erred
// by lately, and by the law of what rounds lose before and after their computation begins. The
// observing node is assumed to choose its level as this one would. An error that was learnt of a
// mode that is not tried any more fades towards that of the other mode, so that a wrong estimate
// does not rule it out for ever; and a few rounds may be spent to try it (BudgetOptions::
// exploration). 70 KB; nothing is allocated after construction. As RoundGuard in all else.
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

  // What a mode is expected to bring, for tests and tools. Nothing where there is no forecast.
  // `as_forecast`: leaves out what forecasts of this mode erred by beyond those of the other one.
  std::optional<Worth> worth_of(TimePoint now, bool degraded, Duration since,
                                const Forecast& forecast, bool as_forecast = false) const;

 private:
  // A round whose first transmission has left.
  struct Entry {
    // Its end-to-end time was learnt.
    bool known = false;
    bool degraded = false;
    // Of the mode it left in, from t0 on.
    Forecast forecast{};
  };

  // Rounds are put into classes by what they lost before their computation.
  static constexpr std::size_t kClasses = 16;
  // What a round of the law lost.
  struct Loss {
    // Before and after its computation began, in ns.
    std::int64_t total = 0;
    std::size_t which = 0;
    // It lost more than `total`: it was not answered.
    bool beyond = false;
  };

  // What forecasts of this variant and mode err by.
  Duration bias(TimePoint now, std::uint8_t key, bool as_forecast) const;
  // Of a round that takes `clean` when nothing is lost and its computation takes no time.
  Worth worth_at(Duration clean, std::uint8_t variant) const;
  void learn(TimePoint now, const ResidualLaw::Sample& sample);
  std::span<const LevelProfile> levels() const;
  // Whether this round is spent to try the mode that `chosen` is not.
  bool explores(TimePoint now, bool degraded, Duration since, const Forecast& forecast,
                const std::optional<Worth>& chosen);

  Duration deadline_;
  BudgetOptions options_;
  Terms terms_;
  std::vector<LevelProfile> configured_;
  // One level, with the run time that results tell of; it serves while none are configured.
  std::vector<LevelProfile> learnt_;
  ResidualLaw law_;
  // The rounds of law_ by what they lost, made anew with each sample.
  std::array<Loss, ResidualLaw::kRounds> losses_{};
  std::array<double, kClasses> rounds_in_class_{};
  Speed speed_;
  Recent computed_;
  RoundRing<Entry> sent_;
  // When each mode was taken last: whole, degraded.
  std::array<std::optional<TimePoint>, 2> tried_{};
  // How many rounds may be spent on trying the other mode.
  double exploration_ = 0;
};

}  // namespace interneuron::guard
