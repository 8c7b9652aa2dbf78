// GuardKind::kBudget at the origin: the mode of the first transmission that maximises the expected
// quality subject to P(round on time) >= target.
//
// Both modes are weighed alike: the forecast of the links, what forecasts of this mode lately erred
// by, and the law of what rounds lose before and after their computation begins; the observing node
// is assumed to choose its level as we would. An error learnt of a mode that is not tried fades
// towards that of the other, so that a wrong estimate does not condemn it for ever. Pure;
// thread-compatible; bounded.
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

  // What a mode is expected to bring; for tests and tools. Nothing when there is no forecast.
  // `as_forecast`: without what its forecasts lately erred by beyond those of the other mode.
  std::optional<Worth> worth_of(TimePoint now, bool degraded, Duration since,
                                const Forecast& forecast, bool as_forecast = false) const;

 private:
  struct Entry {
    bool known = false;  // its end-to-end time was learnt
    bool degraded = false;
    Forecast forecast{};  // from t0
  };

  // Rounds are put into classes by what they lost before their computation.
  static constexpr std::size_t kClasses = 16;
  struct Loss {
    std::int64_t total = 0;  // before and after
    std::size_t which = 0;   // class
    bool beyond = false;     // it lost more than that
  };

  Duration bias(TimePoint now, std::uint8_t key, bool as_forecast) const;
  Worth worth_at(Duration clean, std::uint8_t variant) const;
  void learn(TimePoint now, const ResidualLaw::Sample& sample);
  std::span<const LevelProfile> levels() const;
  bool explores(TimePoint now, bool degraded, Duration since, const Forecast& forecast,
                const std::optional<Worth>& chosen);

  Duration deadline_;
  BudgetOptions options_;
  Terms terms_;
  std::vector<LevelProfile> configured_;
  std::vector<LevelProfile> learnt_;  // one level: while nothing is configured
  ResidualLaw law_;
  std::array<Loss, ResidualLaw::kRounds> losses_{};  // of law_, as it is now
  std::array<double, kClasses> rounds_{};            // per class
  Speed speed_;
  Recent computed_;
  RoundRing<Entry> chosen_;
  std::array<std::optional<TimePoint>, 2> tried_{};  // by mode
  double exploration_ = 0;                           // rounds that may be spent
};

}  // namespace interneuron::guard
