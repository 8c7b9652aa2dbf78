// The two rules behind StageGuard: PaperObserver is that of the paper, BudgetObserver maximises the
// expected quality of the answer. Pure; thread-compatible.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "core/base/round_ring.h"
#include "core/guard/choice.h"
#include "core/guard/residual_law.h"
#include "core/guard/stage_guard.h"
#include "interneuron/pipeline.h"
#include "interneuron/time.h"

namespace interneuron::guard {

// Reference times of one pipeline at one node (docs/paper.md, "Reference times"): the elapsed time
// θ per round and stage is remembered until the indicator tells that the round ended on time, and
// is then folded into the base of the stage. A round that was missed or never decided leaves no
// trace.
//
// θ and base contain the clock offset, and nothing here depends on its value. They come from t0 of
// headers, which may be any 64-bit value: all arithmetic wraps. The memory is constant; a straggler
// of an old round is not recorded.
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

// GuardKind::kPaper at an observing node, the paper's rule (docs/paper.md, "Stage deadlines", and
// "Sacrifice" for the one thing that is added to it): compares the elapsed time θ of a stage with a
// deadline that is derived from the reference times of rounds before and from the tolerance X of
// the header. What is late makes the next module cheaper. As StageGuard in all else.
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

// GuardKind::kBudget at an observing node: takes the level and the hold that maximise the expected
// quality of the answer, in which a miss costs its price.
//
// The end-to-end times that come back in headers tell how long the rest of each round took after
// this node handed it over: rest = θ_N - θ, where θ is the time that had elapsed at the hand-over.
// θ contains the clock offset α and the rest contains -α, so the sum of θ, the computation and the
// rest is free of it. No estimate of α is needed, and decisions are bit-identical for any constant
// offset. As StageGuard in all else; 24 KB per computation, allocated when it is met first.
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
