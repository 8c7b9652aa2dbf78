// GuardKind::kBudget at an observing node: takes the level and the hold that maximise the expected
// quality subject to P(round on time) >= target.
//
// The end-to-end times that come back in headers tell how long the rest of each round took after
// this node handed it over: rest = θ_N - θ, where θ is the time that had elapsed at the hand-over.
// θ contains the clock offset α and the rest contains -α, so the sum of θ, the computation and the
// rest is free of it. No estimate of α is needed, and decisions are bit-identical for any constant
// offset. As StageGuard in all else; 54 KB per computation of the pipeline, allocated when
// it is met first.
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
  // Until the instant of the highest expected value, out of now and the times by which better
  // variants came lately; not at all where none came.
  Hold hold(TimePoint now, const StageEnd& end, const std::optional<ClockView>& clock,
            bool last_stage) override;
  // Late where a computation ends and P(on time) is below the target; never after a communication.
  Verdict end_stage(TimePoint now, const StageEnd& end,
                    const std::optional<ClockView>& clock) override;
  Verdict end_stage_held(const StageEnd& end, const Hold& hold) override;
  // `top` until an end-to-end time has come back.
  LevelChoice begin_computation(TimePoint now, const StageEnd& end,
                                const std::optional<ClockView>& clock,
                                std::span<const LevelProfile> levels, std::size_t top,
                                const Verdict& verdict) override;
  void reset() override;

 private:
  // A round at the computation after one communication, from begin_computation() on. Elapsed times
  // contain the clock offset.
  struct Entry {
    // The computation has ended.
    bool ended = false;
    // The end-to-end time was learnt, or only that the round was missed.
    bool known = false;
    bool beyond = false;
    std::size_t level = 0;
    // The elapsed times at which the computation began and ended.
    Duration start{};
    Duration end{};
    // By how much it began later than its reference.
    Duration before{};
    // The run time of the level by its profile, and as it was expected.
    Duration median{};
    Duration expected{};
    Duration deadline{};
    // StageEnd::ahead.
    Duration ahead{};
  };
  // When the variants of a message came, by which holding one of the others is judged.
  struct Better {
    // The first one of any.
    TimePoint at{};
    // The elapsed time at which the best one came.
    std::optional<Duration> theta;
  };
  // What is learnt of the computation after one communication.
  struct Computation {
    ResidualLaw law;
    // The elapsed times at which it began, by variant and mode.
    Recent starts;
    Speed speed;
    RoundRing<Entry> rounds;
    RoundRing<Better> better;
    // The levels of the computation, as the application named them last.
    std::vector<LevelProfile> levels;
    // StageEnd::ahead of the computation that began last.
    Duration ahead{};
    // What was decided last, which holds while nothing is known (any more).
    std::size_t last_level = 0;
    bool has_decided = false;
  };

  // What is learnt of the computation after this stage; 0: of one that begins at the origin.
  Computation& after(std::size_t stage);
  // The computation that a computation stage of this round belongs to; nullptr where it did not
  // begin here.
  Computation* before(const StageEnd& end);
  static void settle(Computation& c, TimePoint now, RoundId round, RoundState state, E2e e2e);
  static void remember(Computation& c, std::span<const LevelProfile> levels);
  // P(on time) by level of c.levels, when `left` is left for the computation and what it and the
  // rest may lose.
  using Chances = std::array<Chance, kMaxLevels>;
  static Chances chances(const Computation& c, const ResidualLaw::Near& law, Duration left);
  static std::pair<std::size_t, Worth> best_level(const Computation& c, const Chances& chances,
                                                  std::uint8_t variant, const Terms& terms);
  Verdict finish(TimePoint now, const StageEnd& end, Duration theta);

  bool at_origin_;
  // By the number of the stage before.
  std::array<std::unique_ptr<Computation>, kMaxStages + 1> after_;
};

}  // namespace interneuron::guard
