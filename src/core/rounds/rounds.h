// The rounds that pass an endpoint, whoever began them: from the message that comes in (or the
// frame that begins a round) to the message that sets out, or the answer. Joins OwnRounds (the
// rounds that began here), Stages (those in progress here) and Transmissions (the messages that
// leave).
//
// Owned by Endpoint, which feeds it the application's commands and the complete messages of peers.
// Messages are any bytes: one with a malformed header, with a round of ours that never began, or
// with a last stage that does not end here is counted and dropped. A peer speaks for itself alone:
// the origin of what it sends is its own session, or a round that began here and was sent to it;
// anything else is dropped and counted as foreign, unless the configuration names the peer as a
// relay. Memory is bounded for each peer by Stages, and by the ledgers. Pure; thread-compatible.
#pragma once

#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "core/peers/peers.h"
#include "core/rounds/own_rounds.h"
#include "core/rounds/stages.h"
#include "core/rounds/transmissions.h"

namespace interneuron::rounds {

class Rounds {
 public:
  // Throws std::invalid_argument naming the option that is wrong. What happens is appended to
  // `events`; it, `policies`, `peers` and `held` must outlive this.
  Rounds(const EndpointOptions& options, const plan::PolicyRegistry& policies, peers::Peers& peers,
         HeldMemory& held, std::deque<Event>& events);

  // The commands of Endpoint, in its own time.
  RoundRef begin(TimePoint now, PipelineId pipeline);
  Plan preview(TimePoint now, const RoundRef& round, std::span<const std::size_t> variant_bytes,
               MessageClass message_class, std::span<const VariantCost> costs,
               std::optional<PeerId> to);
  std::size_t begin_computation(TimePoint now, const RoundRef& round,
                                std::span<const LevelProfile> levels, std::size_t top);
  SubmitStatus submit(TimePoint now, const RoundRef& round, Variants variants,
                      MessageClass message_class, std::optional<PeerId> to);
  void local_result(TimePoint now, const RoundRef& round, Bytes result);
  void give_up(TimePoint now, const RoundRef& round);

  // A message of this peer is complete.
  void complete(TimePoint now, peers::Peer& peer, wire::MessageBytes message);
  // What is due at or before `now`: held variants first, then the rounds' deadlines.
  void expire(TimePoint now);
  std::optional<TimePoint> next_timeout() const;

  // The clock of this peer has stepped: what was learnt with its clock is dropped.
  void forget_clock(PeerId peer) { stages_.forget_clock(peer); }
  // The peer is gone, or has begun a new session: all that is kept of its rounds is dropped.
  void forget(PeerId peer) { stages_.forget(peer); }

  // Fills in what this peer holds here, beside what waits.
  void fill(PeerId peer, PeerLedger& ledger) const { stages_.fill(peer, ledger); }

  // Those about complete messages; the others are 0.
  const EndpointCounters& counters() const { return counters_; }

 private:
  using ClockOf = Stages::ClockOf;

  // Why a message may not be what its header says.
  enum class Doubt : std::uint8_t { kNone, kBad, kForeign, kForgotten, kOfAnother };
  Doubt judge(const peers::Peer& peer, dispatch::Round& round) const;
  Stages::Speaker speaker(const peers::Peer& peer) const;
  bool is_relay(const peers::Peer& peer) const;
  void arrived(TimePoint now, peers::Peer& peer, Arrived arrived);
  void release(TimePoint now, Held held);
  bool finish(TimePoint now, PeerId from, const dispatch::Round& round, Bytes result);
  void report(std::optional<RoundDone> done);
  void end_computations(TimePoint now, RoundContext& context);
  guard::StageGuard& stage_guard_of(const dispatch::Round& round, const Stages::Speaker& speaker);
  ClockOf clock_of(TimePoint now, const dispatch::Round& round, peers::Peer* peer);

  // Where the next message of a round goes; nullptr where that is not known.
  peers::Peer* destination(TimePoint now, const RoundContext& context, std::optional<PeerId> to);

  peers::Peers& peers_;
  std::deque<Event>& events_;
  // Without ports.
  std::vector<Address> relays_;
  const plan::PolicyRegistry& policies_;
  OwnRounds own_;
  Stages stages_;
  Transmissions transmissions_;
  EndpointCounters counters_;
};

}  // namespace interneuron::rounds
