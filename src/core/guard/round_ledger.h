// The origin's side of one pipeline: begins rounds, gives each exactly one outcome by t0 + D_N, and
// tells the guard of the outcomes (docs/paper.md, "One answer per round"). Pure; thread-compatible;
// bounded (rounds older than their deadline are always decided).
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/round_ring.h"
#include "core/guard/round_guard.h"
#include "interneuron/pipeline.h"

namespace interneuron::guard {

class RoundLedger {
 public:
  // Throws std::invalid_argument when the configuration has no stage, too many, a deadline or
  // period <= 0, or budget options, levels or fallback qualities out of their ranges.
  RoundLedger(PipelineConfig config, SessionId self);

  // What the header of a round carries.
  struct Begun {
    RoundRef ref;
    TimePoint t0{};
    RoundGuard::Sent sent;
  };
  Begun begin(TimePoint now);
  // The header's indicator for a message of `round` sent now.
  Indicator indicator(RoundId round) const;
  RecentE2e recent_e2e(RoundId round) const;

  // Whether the first transmission of an open round is to be degraded, for a guard that weighs the
  // modes; asked once, the answer stays.
  bool weighs() const { return guard_->weighs(); }
  bool choose_degraded(TimePoint now, RoundId round, const Forecast& normal,
                       const Forecast& degraded);

  // A remote result is there. Nothing when it is late or the round is decided: it is dropped, but
  // its time is learnt, and it may yet answer a later round that is missed.
  std::optional<RoundDone> remote_result(TimePoint now, RoundId round, Bytes result, bool degraded,
                                         const Spent& spent = {});
  // This round's own local result is there: the answer of a round that stays here, else kept.
  std::optional<RoundDone> local_result(TimePoint now, RoundId round, Bytes result);
  // The policy decided that the round stays here: that is no miss, and the answer is given as soon
  // as the local result is there.
  std::optional<RoundDone> stay_local(TimePoint now, RoundId round);
  // Rounds whose deadline has passed at `now` (t0 + D_N <= now) are answered locally: by the local
  // result or the last remote one, whichever is worth more (FallbackQuality).
  std::vector<RoundDone> expire(TimePoint now);

  const Begun* open(RoundId round) const;
  std::optional<TimePoint> next_timeout() const;
  const PipelineConfig& config() const { return config_; }
  StageGuard& observer() { return *observer_; }

 private:
  struct Open {
    Begun begun;
    std::optional<Bytes> local;
    bool stays_local = false;
  };
  struct Last {
    RoundId round{};
    Bytes result;
    double quality = 0;  // expected, of a remote one
  };
  // What is remembered of a round once it is open no more.
  struct Past {
    RoundState state{};
    TimePoint t0{};
    E2e e2e;
  };
  Open* find(RoundId round);
  RoundDone decide(TimePoint now, RoundId round, Outcome outcome);
  RoundDone decide_locally(TimePoint now, Open& open);
  E2e remember(TimePoint now, const Begun& begun, RoundState state);
  void learn_late(TimePoint now, RoundId round, Bytes result, const Spent& spent);
  void keep_last(RoundId round, const Bytes& result);
  void keep_remote(RoundId round, const Bytes& result, const Spent& spent);
  void answer(RoundDone& done, std::optional<Bytes> local);

  PipelineConfig config_;
  SessionId self_;
  std::unique_ptr<RoundGuard> guard_;
  std::unique_ptr<StageGuard> observer_;
  std::uint32_t next_round_ = 0;
  std::deque<Open> open_;  // oldest first
  RoundRing<Past> past_;
  std::optional<Last> last_;         // local or remote
  std::optional<Last> last_remote_;  // only where FallbackQuality says what it is worth
};

}  // namespace interneuron::guard
