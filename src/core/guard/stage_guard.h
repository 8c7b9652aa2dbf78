// The guard's side of an observing node: what it learns of a pipeline's stages, how long it holds a
// smaller variant, which level a computation gets. One rule per GuardKind behind one interface; one
// instance per (origin session, pipeline): state is never shared between vehicles. Pure;
// thread-compatible; bounded.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "core/guard/clock_offset.h"
#include "interneuron/guard.h"
#include "interneuron/pipeline.h"

namespace interneuron::guard {

// What the origin asks of every node of its pipeline; rides in the headers.
struct Terms {
  GuardKind kind = GuardKind::kPaper;
  double target = BudgetOptions{}.target;
  double miss_price = BudgetOptions{}.miss_price;
  double local_quality = 0;  // of an answer without a remote result
};

// A round at the end of stage `stage`, as its header tells.
struct StageEnd {
  RoundId round{};
  std::size_t stage = 1;
  PeerTime t0{};
  std::int16_t x_permille = 0;
  Duration deadline{};  // D_N
  std::uint8_t variant = 0;
  std::uint8_t best_planned = 0;
  bool degraded = false;
  bool is_computation = false;
  Terms terms{};
};

// The end-to-end time of a decided round: nothing = not known; kNever = later than can be told, or
// never.
using E2e = std::optional<Duration>;
inline constexpr Duration kNever = Duration::max();
using RecentE2e = std::array<E2e, kIndicatorRounds>;  // [i]: round r - 1 - i, as in Indicator

// A computation's level, and what its round had lost before it, against this node's own reference
// for the same variant and mode; offset-free. Nothing while there is no reference.
struct LevelChoice {
  std::size_t level = 0;
  std::optional<Duration> excess;
};

class StageGuard {
 public:
  virtual ~StageGuard() = default;

  // What the header of round `current` tells of the rounds before.
  virtual void learn(TimePoint now, RoundId current, const Indicator& indicator,
                     const RecentE2e& e2e) = 0;
  virtual void settle(TimePoint now, RoundId round, RoundState state, E2e e2e) = 0;

  // base_n, the reference time of a stage, if there is one (kBudget has none).
  virtual std::optional<Duration> base(TimePoint, std::size_t /*stage*/) { return std::nullopt; }

  // A variant came in, whatever becomes of it; before hold() or end_stage().
  virtual void note_arrival(TimePoint, const StageEnd&) {}

  // Until when a smaller variant that arrived now may be held for a better one; at or before `now`
  // = not at all.
  struct Hold {
    TimePoint until{};
    bool is_stage_deadline = false;  // false: a bound ended the hold before D_n, or there is no D_n
    bool has_reference = false;      // there is a D_n
  };
  virtual Hold hold(TimePoint now, const StageEnd& end, const std::optional<ClockView>& clock,
                    bool last_stage) = 0;

  // The stage ends now: records θn and judges it.
  virtual Verdict end_stage(TimePoint now, const StageEnd& end,
                            const std::optional<ClockView>& clock) = 0;
  // A held variant is handed over by the timer: θn is exactly the instant of release, and timer
  // lateness never counts.
  virtual Verdict end_stage_held(const StageEnd& end, const Hold& hold) = 0;

  // The computation after stage `end` begins now. `levels`: not empty; `top`: the one otherwise
  // chosen, < levels.size(); `verdict`: of the stage.
  virtual LevelChoice begin_computation(TimePoint now, const StageEnd& end,
                                        std::span<const LevelProfile> levels, std::size_t top,
                                        const Verdict& verdict) = 0;

  // A clock stepped or the session is new: nothing that contains the clock offset holds.
  virtual void reset() = 0;
};

// `at_origin`: this node stamped t0, so α = 0 and the configured D_N bounds the last stage.
std::unique_ptr<StageGuard> make_stage_guard(GuardKind kind, bool at_origin);

}  // namespace interneuron::guard
