// The rounds of one pipeline at their origin: begins them, gives each exactly one outcome by
// t0 + D_N, picks the answer that the application gets, and tells both guards of the outcomes
// (docs/paper.md, "One answer per round").
//
// Owned by OwnRounds, which feeds it. Bounds: open rounds are those of the last D_N, decided ones
// are remembered for 64 rounds, and at most two results are kept for rounds to come. What a peer
// can do is to answer: a result for a round that is decided or was forgotten is dropped, and
// `Spent` is only believed as statistics. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/base/round_ring.h"
#include "core/guard/round_guard.h"
#include "interneuron/pipeline.h"

namespace interneuron::guard {

class RoundLedger {
 public:
  // Throws std::invalid_argument when the configuration has no stage, too many, a deadline or
  // period <= 0, or budget options, levels or fallback qualities out of their ranges.
  RoundLedger(PipelineConfig config, SessionId self, const Ablation& ablation = {});

  // What the header of a round carries.
  struct Begun {
    RoundRef ref;
    TimePoint t0{};
    RoundGuard::Sent sent;
  };
  Begun begin(TimePoint now);
  // The outcomes and the end-to-end times of the 16 rounds before `round`, for its header.
  Indicator indicator(RoundId round) const;
  RecentE2e recent_e2e(RoundId round) const;

  // Whether choose_mode() is to be asked.
  bool weighs() const { return guard_->weighs(); }
  // The mode of the first transmission of an open round, as RoundGuard::choose_mode(); the last one
  // is the degraded one. What was decided last of a round counts.
  std::size_t choose_mode(TimePoint now, RoundId round, std::span<const Forecast> modes);

  // A remote result is there. Nothing where it is late or the round is decided: then it is dropped,
  // but its time is learnt, and it may still answer a later round that is missed.
  std::optional<RoundDone> remote_result(TimePoint now, RoundId round, Bytes result, bool degraded,
                                         const Spent& spent = {});
  // The local backup of the round is ready. It decides a round that stays here or was given up;
  // else it is kept until the deadline.
  std::optional<RoundDone> local_result(TimePoint now, RoundId round, Bytes result);
  // The policy has decided that the round stays here. That is no miss, and the answer is given as
  // soon as the local result is there.
  std::optional<RoundDone> stay_local(TimePoint now, RoundId round);
  // No remote result will come, as whoever was to compute it says. That is a miss; the answer is
  // given as soon as the local result is there, at the deadline at the latest. A remote result that
  // comes before it nevertheless counts.
  std::optional<RoundDone> give_up(TimePoint now, RoundId round);
  // Decides the rounds whose deadline has passed (t0 + D_N <= now). They are answered by the local
  // result or by the last remote one, whichever is worth more (FallbackQuality).
  std::vector<RoundDone> expire(TimePoint now);

  // A round that is not decided yet, else nullptr.
  const Begun* open(RoundId round) const;
  std::optional<TimePoint> next_timeout() const;
  const PipelineConfig& config() const { return config_; }
  // The guard of the stages that end here.
  StageGuard& stage_guard() { return *observer_; }

 private:
  struct Open {
    Begun begun;
    std::optional<Bytes> local;
    bool stays_local = false;
    bool given_up = false;
  };
  struct Last {
    RoundId round{};
    Bytes result;
    // Where it is a remote result, the quality to be expected of it.
    double quality = 0;
  };
  // What is remembered of a round, whether it is open or decided.
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
  // Oldest first.
  std::deque<Open> open_;
  RoundRing<Past> past_;
  // The newest result of any kind.
  std::optional<Last> last_;
  // The newest remote one; kept only where FallbackQuality tells what it is worth.
  std::optional<Last> last_remote_;
};

}  // namespace interneuron::guard
