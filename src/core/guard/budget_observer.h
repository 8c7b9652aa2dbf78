// GuardKind::kBudget at an observing node: takes the level and the hold that maximise the expected
// quality of the answer, in which a miss costs its price.
//
// The end-to-end times that come back in headers tell how long the rest of each round took after
// this node handed it over: rest = θ_N - θ, where θ is the time that had elapsed at the hand-over.
// θ contains the clock offset α and the rest contains -α, so the sum of θ, the computation and the
// rest is free of it. No estimate of α is needed, and decisions are bit-identical for any constant
// offset. As StageGuard in all else; 24 KB per computation, allocated when it is met first.
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
  void settle(TimePoint now, RoundId round, RoundState state, E2e e2e) override;
  void note_arrival(TimePoint now, const StageEnd& end) override;
  // Until the better variant has usually come, if that is worth more in expectation than going on
  // with this one.
  Hold hold(TimePoint now, const StageEnd& end, const std::optional<ClockView>& clock,
            bool last_stage) override;
  // Never late: what a round has lost weighs in the choices that follow.
  Verdict end_stage(TimePoint now, const StageEnd& end,
                    const std::optional<ClockView>& clock) override;
  Verdict end_stage_held(const StageEnd& end, const Hold& hold) override {
    return end_stage(hold.until, end, std::nullopt);
  }
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
    // The computation has ended; the end-to-end time was learnt.
    bool ended = false;
    bool known = false;
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
    Duration ahead{};  // StageEnd::ahead
  };
  // What is learnt of the computation after one communication.
  struct Computation {
    ResidualLaw law;
    // The elapsed times at which it began, by key_of().
    Recent starts;
    // The elapsed times at which the best variant that was planned came, by variant: holding one of
    // the others is judged by them.
    Recent better;
    Speed speed;
    RoundRing<Entry> rounds;
    // The levels of the computation, as the application named them last.
    std::vector<LevelProfile> levels;
    // StageEnd::ahead of the computation that began last.
    Duration ahead{};
    // What was decided last, which holds while nothing is known (any more).
    std::optional<std::size_t> last_level;
  };

  // What is learnt of the computation after this stage; 0: of one that begins at the origin.
  Computation& after(std::size_t stage);
  // The computation that a computation stage of this round belongs to; nullptr where it did not
  // begin here.
  Computation* before(const StageEnd& end);
  // How much later than usual the computation begins when `theta` has elapsed, compared with the
  // rounds that came in the same variant and mode. Nothing while there is none.
  static std::optional<Duration> excess(const Computation& c, TimePoint now, const StageEnd& end,
                                        Duration theta);

  // By the number of the stage before.
  std::array<std::unique_ptr<Computation>, kMaxStages + 1> after_;
};

}  // namespace interneuron::guard
