// The rounds that begin at this endpoint: a guard::RoundLedger per pipeline, what the messages of
// each round tell of it when they set out, and the peers that they were sent to. Owned and fed by
// Rounds. Peers name rounds in the headers of their results, so every lookup may fail. Pure;
// thread-compatible.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "core/base/round_ring.h"
#include "core/guard/round_ledger.h"
#include "core/rounds/kept_rounds.h"
#include "interneuron/endpoint.h"
#include "interneuron/few.h"

namespace interneuron::rounds {

class OwnRounds {
 public:
  // Throws std::invalid_argument naming the pipeline that is given twice or configured wrongly.
  OwnRounds(SessionId self, const std::vector<PipelineConfig>& pipelines, const Ablation& ablation);

  // Begins a round. Throws std::invalid_argument when there is no such pipeline.
  RoundContext begin(TimePoint now, PipelineId pipeline);

  bool is_mine(const RoundRef& round) const { return round.origin == self_; }
  // Whether this is a round of ours that has begun. A result for one that has not is forged.
  bool has_begun(const RoundRef& round) const;
  // A message of this round is sent to this peer.
  void note_sent(const RoundRef& round, PeerId to);
  // Whether it was sent to this peer; nothing where the round is not one of the last 64 that began.
  std::optional<bool> was_sent_to(const RoundRef& round, PeerId peer) const;
  // Puts the true beginning, deadline and period of a round of ours in the place of what a peer has
  // made of them. False: the round is not one of the last 64 that began.
  bool restore(dispatch::Round& round) const;
  // The ledger of the round's pipeline; nullptr where the round is not ours or there is no such
  // pipeline.
  guard::RoundLedger* find(const RoundRef& round);

  // Decides the rounds whose deadline has passed.
  std::vector<RoundDone> expire(TimePoint now);
  std::optional<TimePoint> next_timeout() const;

 private:
  struct Begun {
    TimePoint t0{};
    Few<PeerId, kMaxStages> sent_to;
  };
  struct Pipeline {
    guard::RoundLedger ledger;
    // What all of its rounds have in common.
    dispatch::Round common;
    // How many rounds have begun so far.
    std::uint32_t begun = 0;
    RoundRing<Begun> rounds;
  };
  const Begun* find_begun(const RoundRef& round) const;

  SessionId self_;
  std::map<PipelineId, Pipeline> pipelines_;
};

}  // namespace interneuron::rounds
