// The rounds in progress at one endpoint: which stages were served, which variants are held for a
// better one, and which rounds the application works on. Stages asks the policy of a round
// (merge()) and the guard of its pipeline (guard::StageGuard) about each message, and carries out
// what they answer; it judges nothing itself.
//
// Owned and fed by Rounds, which has checked that the peer may speak for the origin that a header
// names. Headers come from peers and may name any pipeline and round. What is kept is kept for each
// peer apart, so that no peer pushes out what another one has: guards and served stages of a few
// pipelines (the least recently used one makes room), a few rounds that the application works on
// (the oldest makes room), a few messages that wait; PeerLimits says how many, and what is kept of
// rounds that began here is bounded by the pipelines there are and by kOwnContexts. A message that
// finds no room to wait is served at once, and one of a round that is too old to be remembered is
// dropped. Pure; thread-compatible.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/round_ring.h"
#include "core/guard/stage_guard.h"
#include "core/rounds/kept_rounds.h"
#include "interneuron/endpoint.h"

namespace interneuron::rounds {

class Stages {
 public:
  // Whose bounds a call is subject to: who speaks for the round (kOurselves for rounds that began
  // here), and whether it is a relay that the configuration names.
  struct Speaker {
    PeerId peer{};
    bool is_relay = false;
  };

  // `memory`, for what waits, must outlive this.
  Stages(SessionId self, const PeerLimits& limits, const Ablation& ablation, HeldMemory& memory)
      : self_(self), limits_(limits), ablation_(ablation), held_(memory) {}

  // The clock between the origin of a round and here; nothing at the origin and while it is not
  // known.
  using ClockOf = std::optional<guard::ClockView>;

  // What is to become of an arrived message.
  enum class Action : std::uint8_t {
    // Serve it now, by serve() or, after the last stage, by finish().
    kServe,
    // It was taken and is held; release() returns it when its time is over.
    kHold,
    // The stage was served already, or a variant at least as good is held.
    kDrop,
  };
  // `policy`: of the round, nullptr where it is not registered here; then the first variant that
  // comes is served.
  Action arrive(TimePoint now, const Speaker& speaker, Arrived& arrived, const Policy* policy,
                const ClockOf& clock, guard::StageGuard& guard);

  // Serves a message whose stage the guard has judged at `now`: drops what is held of the stage,
  // and opens the round's context for the application.
  Delivered serve(TimePoint now, const Speaker& speaker, Arrived arrived, const Verdict& verdict);

  // Takes the held variants whose time is over at `now`, in the order of their time. Each is served
  // as at the instant at which its hold was to end.
  std::vector<Held> release(TimePoint now) { return held_.release(now); }

  // The stage of this message, which this peer has sent, is over, whatever became of it: further
  // copies are dropped.
  void finish(PeerId peer, const dispatch::Round& round);

  // When the next hold ends.
  std::optional<TimePoint> next_timeout() const { return held_.next_timeout(); }

  // The context of a round that the application works on; nullptr where there is none (any more).
  RoundContext* context(const RoundRef& round) { return contexts_.find(round); }
  // Whether the application works on a round of this name that came from another peer.
  bool is_of_another(PeerId peer, const RoundRef& round) const {
    return contexts_.owner(round).value_or(peer) != peer;
  }
  // Whether a message of this round was handed to the application here lately: of the last 64
  // rounds of its pipeline. Looks at the pipelines of all peers.
  bool has_served(const RoundRef& round) const;
  // Opens the context of a round that begins here. It is kept for twice the deadline, since a
  // computation may hand over late.
  void open(TimePoint now, RoundContext context);
  void close(const RoundRef& round) { contexts_.close(round); }

  // How long a round may take, as far as its origin is believed: what it states, at most
  // PeerLimits::longest_deadline where it began elsewhere.
  Duration bounded_deadline(const dispatch::Round& round) const {
    return is_own(round) ? round.qos.deadline
                         : std::min(round.qos.deadline, limits_.longest_deadline);
  }
  // The guard of the pipeline that this round belongs to, of the kind that the origin asks for.
  // Valid until the next call.
  guard::StageGuard& stage_guard(const dispatch::Round& round, const Speaker& speaker);
  // The clock of this peer has stepped.
  void forget_clock(PeerId peer);
  // The peer is gone, or has begun a new session: what is kept of it goes.
  void forget(PeerId peer);

  // Limits that have struck since the last call, all of them of the peer that was then served.
  using Struck = Few<PeerLimit, kPeerLimitCount>;
  Struck take_struck();
  // Fills in what this peer holds here, beside what waits.
  void fill(PeerId peer, PeerLedger& ledger) const;

 private:
  // Rounds that began here and that the application works on. An application that has more of them
  // open has forgotten them; no measurement behind this value.
  static constexpr std::size_t kOwnContexts = 1024;

  struct Key {
    PeerId peer{};
    SessionId origin{};
    PipelineId pipeline{};
    friend auto operator<=>(const Key&, const Key&) = default;
  };
  // Which stages of a round were served: bit n stands for stage n.
  using Served = std::uint32_t;
  struct Pipeline {
    // Nothing for a pipeline whose rounds begin here: guard::RoundLedger has it.
    std::unique_ptr<guard::StageGuard> guard;
    GuardKind kind{};
    RoundRing<Served> served;
    // The number of the use that was the last one.
    std::uint64_t used = 0;
  };

  bool is_own(const dispatch::Round& round) const { return round.ref.origin == self_; }
  // Whose bounds hold for a round that this peer has sent.
  PeerId owner(PeerId peer, const dispatch::Round& round) const {
    return is_own(round) ? kOurselves : peer;
  }
  Pipeline& pipeline(const dispatch::Round& round, const Speaker& speaker);
  void make_room_for_pipeline(const Speaker& speaker);
  Served* served(PeerId peer, const dispatch::Round& round);
  void strike_long_deadline(const dispatch::Round& round);
  std::size_t scaled(std::size_t limit, const Speaker& speaker) const {
    return speaker.is_relay ? limit * kRelayedPeers : limit;
  }
  void strike(PeerLimit limit);

  SessionId self_;
  PeerLimits limits_;
  Ablation ablation_;
  // In the order of their peers.
  std::map<Key, Pipeline> pipelines_;
  Contexts contexts_;
  HeldVariants held_;
  std::uint64_t uses_ = 0;
  Struck struck_;
};

}  // namespace interneuron::rounds
