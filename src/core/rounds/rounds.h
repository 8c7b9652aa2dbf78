// The rounds that pass an endpoint, whoever began them: from the message that comes in (or the
// frame that begins one) to the message that sets out, or the answer. Joins Stages (what goes on
// here), OwnRounds (what began here) and Dispatch (what leaves). Pure; thread-compatible; bounded.
#pragma once

#include <deque>
#include <optional>
#include <span>

#include "core/peers/peers.h"
#include "core/rounds/dispatch.h"
#include "core/rounds/own_rounds.h"
#include "core/rounds/stages.h"

namespace interneuron {

class Rounds {
 public:
  // Throws std::invalid_argument naming the option. What happens is appended to `events`.
  Rounds(const EndpointOptions& options, Peers& peers, std::deque<Event>& events);

  // Endpoint's commands, in the endpoint's own time.
  RoundRef begin(TimePoint now, PipelineId pipeline);
  Plan preview(TimePoint now, const RoundRef& round, std::span<const std::size_t> variant_bytes,
               MessageClass message_class, std::span<const VariantCost> costs,
               std::optional<PeerId> to);
  std::size_t begin_computation(TimePoint now, const RoundRef& round,
                                std::span<const LevelProfile> levels, std::size_t top);
  SubmitStatus submit(TimePoint now, const RoundRef& round, Variants variants,
                      MessageClass message_class, std::optional<PeerId> to);
  void local_result(TimePoint now, const RoundRef& round, Bytes result);

  // A message of this peer is complete.
  void complete(TimePoint now, Peer& peer, const Bytes& message);
  // What is due at or before `now`: held variants first, then the rounds' deadlines.
  void expire(TimePoint now);
  std::optional<TimePoint> next_timeout() const;

  // A clock stepped or the peer is new: nothing that contains its offset holds.
  void forget_clock(PeerId peer) { stages_.forget_clock(peer); }

  // Of messages that are complete.
  const EndpointCounters& counters() const { return counters_; }

 private:
  using ClockOf = Dispatch::ClockOf;

  void release(Stages::Released released);
  bool finish(TimePoint now, const wire::RoundHeader& header, Bytes result);
  void report(std::optional<RoundDone> done);
  void end_computations(TimePoint now, RoundContext& context);
  guard::StageGuard& observer_of(const wire::RoundHeader& header, PeerId via);
  ClockOf clock_of(TimePoint now, const wire::RoundHeader& header, Peer* peer);

  // The next transmission of a round.
  Peer* destination(const RoundContext& context, std::optional<PeerId> to);
  Guidance guidance(TimePoint now, const RoundContext& context, const ClockOf& clock);
  void choose_mode(TimePoint now, RoundContext& context, const Peer& peer,
                   MessageClass message_class, std::span<const std::size_t> variant_bytes,
                   std::span<const VariantCost> costs);

  Peers& peers_;
  std::deque<Event>& events_;
  Dispatch dispatch_;
  OwnRounds own_;
  Stages stages_;
  EndpointCounters counters_;
};

}  // namespace interneuron
