// The guard at an observing node: what it learns of the stages of a pipeline, how long it holds a
// smaller variant, which level a computation gets. StageGuard is the interface that rounds use;
// PaperObserver and BudgetObserver are the two rules behind it, one per GuardKind.
//
// An observing node is any node at which stages end: the roadside unit, and the origin itself for
// the last stage. There is one instance per origin session and pipeline, so that vehicles never
// share what was learnt of one of them. Rounds feeds it in this order:
//
//   learn()              at each message, with what its header tells of the rounds before
//   note_arrival()       at each variant, whatever becomes of it
//   hold()               for a smaller variant that could give way to a better one
//   end_stage()          when the message is handed over, or the application hands its result over
//   begin_computation()  when the application begins to compute
//   settle()             at the origin only, when a round is decided
//
// Everything in StageEnd, Indicator and RecentE2e is a peer's bytes and may be false:
// implementations use bounded memory, never fail, and compute with integers that wrap. A hostile
// origin can spoil only what is learnt of its own pipelines. Pure; thread-compatible.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "core/base/ablation.h"
#include "core/guard/clock_offset.h"
#include "interneuron/guard.h"
#include "interneuron/pipeline.h"

namespace interneuron::guard {

// What the origin asks of every node of its pipeline. Each round's header carries it.
struct Terms {
  GuardKind kind = GuardKind::kPaper;
  // As BudgetOptions has it.
  double miss_price = BudgetOptions{}.miss_price;
  // Expected quality of an answer without a remote result.
  double local_quality = 0;
};

// A round at the end of one of its stages, as its header tells.
struct StageEnd {
  RoundId round{};
  // The stage that ends, from 1 on.
  std::size_t stage = 1;
  // When the round began, on the origin's clock.
  PeerTime t0{};
  // The tolerance X in 1/1000.
  std::int16_t x_permille = 0;
  // The end-to-end deadline D_N.
  Duration deadline{};
  // The variant of the message, and the best one that its sender planned. 0 is the best there is.
  std::uint8_t variant = 0;
  std::uint8_t best_planned = 0;
  // The communication was sacrificed: it carries smaller variants only.
  bool degraded = false;
  bool is_computation = false;
  Terms terms{};
  // How long a message takes from here to the peer that the input came from, by the links as they
  // are now. Given to begin_computation() alone: it stands for the way of the answer, and what it
  // errs by is learnt. Zero where no link is measured, and where the computation begins at the
  // origin. Measured here, so it contains no clock offset.
  Duration ahead{};
};

// The end-to-end time of a decided round. Nothing where it is not known; kNever where the round was
// not answered, or later than a header can tell.
using E2e = std::optional<Duration>;
inline constexpr Duration kNever = Duration::max();
// Entry [i] is about round r - 1 - i, as in Indicator.
using RecentE2e = std::array<E2e, kIndicatorRounds>;

// The level of a computation, as begin_computation() answers.
struct LevelChoice {
  std::size_t level = 0;
  // How much later than usual the computation begins, compared with the rounds that came here in
  // the same variant and mode. Free of the clock offset. Nothing while there is no such round.
  std::optional<Duration> excess;
};

class StageGuard {
 public:
  virtual ~StageGuard() = default;

  // Applies the outcomes and the end-to-end times of the rounds before `current`. They may be told
  // again with every header; each counts once.
  void learn(TimePoint now, RoundId current, const Indicator& indicator, const RecentE2e& e2e);
  // Applies the outcome of one round.
  virtual void settle(TimePoint now, RoundId round, RoundState state, E2e e2e) = 0;

  // The reference time base_n of a stage. Nothing where there is none (yet); kBudget has none.
  virtual std::optional<Duration> base(TimePoint, std::size_t /*stage*/) { return std::nullopt; }

  // A variant has come in. Call it before hold() and end_stage().
  virtual void note_arrival(TimePoint, const StageEnd&) {}

  struct Hold {
    // How long the variant may be held; at or before `now`: not at all.
    TimePoint until{};
    // `until` is the stage deadline D_n. False where another bound ends the hold before D_n, and
    // where there is no D_n.
    bool is_stage_deadline = false;
    // There is a D_n, or what stands for it.
    bool has_reference = false;
  };
  // How long a smaller variant that arrived now may wait for a better one. `clock`: between the
  // origin and this node, nothing while it is not known; `last_stage`: the round ends with it.
  virtual Hold hold(TimePoint now, const StageEnd& end, const std::optional<ClockView>& clock,
                    bool last_stage) = 0;

  // The stage ends now: records the elapsed time θ and judges it.
  virtual Verdict end_stage(TimePoint now, const StageEnd& end,
                            const std::optional<ClockView>& clock) = 0;
  // The stage ends because a hold is over. Recorded is the instant at which the hold was to end, so
  // that the lateness of the timer never counts.
  virtual Verdict end_stage_held(const StageEnd& end, const Hold& hold) = 0;

  // The computation after stage `end` begins now. `levels`: from the lowest quality to the highest,
  // not empty; `top`: the level that would be taken otherwise, < levels.size(); `verdict`: of the
  // stage that ended.
  virtual LevelChoice begin_computation(TimePoint now, const StageEnd& end,
                                        const std::optional<ClockView>& clock,
                                        std::span<const LevelProfile> levels, std::size_t top,
                                        const Verdict& verdict) = 0;

  // A clock has stepped, or the peer has begun a new session: what contains the clock offset is
  // dropped.
  virtual void reset() = 0;
};

// The level of a computation after a stage that ended with this verdict, by guard kPaper
// (docs/paper.md, "Sacrifice"). `levels`: from the lowest quality to the highest; `top`: the level
// that would be taken otherwise. When the stage was late: the best level at least one step below
// `top` whose median run time makes up for the overrun, R[level] <= R[top] - overrun; where none is
// so short, the lowest.
std::size_t sacrificed_level(std::span<const LevelProfile> levels, std::size_t top,
                             const Verdict& verdict);

// `at_origin`: this node stamped t0. Its clock has no offset to itself, and the configured D_N
// bounds the last stage.
std::unique_ptr<StageGuard> make_stage_guard(GuardKind kind, bool at_origin,
                                             const Ablation& ablation);

}  // namespace interneuron::guard
