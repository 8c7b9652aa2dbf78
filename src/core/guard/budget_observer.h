// GuardKind::kBudget at an observing node: levels and holds that maximise the expected quality
// subject to P(round on time) >= target.
//
// The end-to-end times that come back in headers tell how long the rest of each round took after
// this node handed it over, R = θ_N - θ. θ contains the clock offset α and R contains -α, so
// θ + computation + R is free of it: no estimate of α is needed, and decisions are bit-identical
// for any constant offset. Pure; thread-compatible; bounded.
#pragma once

#include <array>
#include <memory>

#include "core/base/round_ring.h"
#include "core/guard/choice.h"
#include "core/guard/residual_law.h"
#include "core/guard/stage_guard.h"

namespace interneuron::guard {

class BudgetObserver final : public StageGuard {
 public:
  explicit BudgetObserver(bool at_origin) : at_origin_(at_origin) {}

  void learn(TimePoint now, RoundId current, const Indicator& indicator,
             const RecentE2e& e2e) override;
  void settle(TimePoint now, RoundId round, RoundState state, E2e e2e) override;
  void note_arrival(TimePoint now, const StageEnd& end) override;
  // Until the instant of the highest expected value, of now and the times at which better variants
  // came lately; at once where none came.
  Hold hold(TimePoint now, const StageEnd& end, const std::optional<ClockView>& clock,
            bool last_stage) override;
  // Late: the computation ended, and P(on time) is below the target.
  Verdict end_stage(TimePoint now, const StageEnd& end,
                    const std::optional<ClockView>& clock) override;
  Verdict end_stage_held(const StageEnd& end, const Hold& hold) override;
  LevelChoice begin_computation(TimePoint now, const StageEnd& end,
                                std::span<const LevelProfile> levels, std::size_t top,
                                const Verdict& verdict) override;
  void reset() override;

 private:
  // A round at the computation after one communication.
  struct Entry {
    bool ended = false;
    bool known = false;  // its end-to-end time was learnt
    bool beyond = false;
    std::size_t level = 0;
    Duration start{};     // θ
    Duration end{};       // θ
    Duration before{};    // start beyond its reference
    Duration median{};    // of its level, by the profile
    Duration expected{};  // the same as it was expected
    Duration deadline{};
  };
  // When the better of a message's variants came; what holding one of the others is judged by.
  struct Better {
    TimePoint at{};
    std::optional<Duration> theta;
  };
  // The computation after one communication stage.
  struct Computation {
    ResidualLaw law;
    Recent starts;  // θ by variant and mode
    Speed speed;
    RoundRing<Entry> rounds;
    RoundRing<Better> better;
    std::vector<LevelProfile> levels;  // as last told
    std::size_t last_level = 0;
    bool has_chosen = false;
  };

  Computation& after(std::size_t stage);
  // The computation that a computation stage of this round belongs to.
  Computation* before(const StageEnd& end);
  static void settle(Computation& c, TimePoint now, RoundId round, RoundState state, E2e e2e);
  static void remember(Computation& c, std::span<const LevelProfile> levels);
  // P(on time) per level, of c.levels, when so much is left.
  using Chances = std::array<Chance, kMaxLevels>;
  static Chances chances(const Computation& c, const ResidualLaw::Near& law, Duration left);
  static std::pair<std::size_t, Worth> best_level(const Computation& c, const Chances& chances,
                                                  std::uint8_t variant, const Terms& terms);
  Verdict finish(TimePoint now, const StageEnd& end, Duration theta);

  bool at_origin_;
  std::array<std::unique_ptr<Computation>, kMaxStages + 1> after_;  // by stage; 0: at the origin
};

}  // namespace interneuron::guard
