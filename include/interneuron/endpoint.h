// The pure door: an Endpoint turns (time, bytes) into (bytes, events). Node (real sockets) and
// sim::World (virtual time) drive the same Endpoint.
//
// Four kinds of call: commands and inputs take `now`; outputs are polled: after any call, drain
// poll_transmit() and poll_event(), then wait until next_timeout() or the next input and call
// handle_timeout(). Early or spurious calls are harmless. If `now` goes back, the endpoint adds the
// difference, so that its own time never does (docs/paper.md, "Clock steps").
//
// At one instant the order of calls is: arrivals, then timeouts; a result that arrives exactly at
// D_N is on time. No exceptions but std::invalid_argument for what the programmer passed (a
// pipeline without stages, an unknown round); the peer's bytes never throw: they are counted and
// dropped. Thread-compatible.
#pragma once

#include <array>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "interneuron/address.h"
#include "interneuron/link.h"
#include "interneuron/pipeline.h"
#include "interneuron/policy.h"
#include "interneuron/submit_status.h"
#include "interneuron/units.h"

namespace interneuron {

// A UDP payload that came in on a link.
struct Datagram {
  LinkId link{};
  Address from{};
  ByteView bytes;
};

// A UDP payload to send: the first `size` bytes of the buffer given to poll_transmit().
struct Transmit {
  LinkId link{};
  Address to{};
  std::size_t size = 0;
};

// The largest UDP payload, in bytes: a carrier is known to reorder IP packets above 1440 bytes
// (docs/constants.md, "Datagrams and sockets"), and 1400 leaves room for IPv6 and a tunnel.
inline constexpr std::size_t kMaxDatagramBytes = 1400;

// A peer was heard and has heard us: the round trip works.
struct PeerReady {
  PeerId peer{};
};
// A known peer began a new life (another session id): all that was learnt of its clock and stages
// is dropped.
struct PeerRestarted {
  PeerId peer{};
};
// A peer was silent for kPeerSilence (src/core/peers/peers.h) and is forgotten, unless it was
// connected to by us.
struct PeerLost {
  PeerId peer{};
};
// What a policy decided for a message of ours: which variants go over which links, and whether no
// link met its floor. Links are named as in links().
struct Planned {
  RoundRef round;
  std::uint8_t stage = 0;
  Plan plan;
};

// What the traffic of a path says of it has changed. `reason`: a few words with the figures, for
// people.
struct PathChanged {
  PeerId peer{};
  LinkId link{};
  PathState from{};
  PathState to{};
  std::string reason;
};

using Event =
    std::variant<Delivered, RoundDone, PeerReady, PeerRestarted, PeerLost, Planned, PathChanged>;

struct EndpointOptions {
  SessionId session{};                    // random, not 0, new at every start
  std::vector<PipelineConfig> pipelines;  // those whose rounds begin here
  PolicySet policies;                     // must hold every policy that pipelines name
  bool accept_peers = false;              // true on a roadside unit: peers may come unannounced
  std::size_t max_peers = 64;             // bound on unannounced peers
  bool repair = true;                     // lost fragments are sent again while the deadline allows
};

// Counters per link over all peers; every received datagram is in exactly one of received,
// duplicates, malformed, refused.
struct LinkCounters {
  std::uint64_t sent_packets = 0;
  std::uint64_t sent_bytes = 0;
  std::uint64_t received_packets = 0;
  std::uint64_t received_bytes = 0;
  std::uint64_t duplicate_packets = 0;  // a packet number seen before, or too old to tell
  std::uint64_t malformed_packets = 0;
  std::uint64_t refused_packets = 0;  // well-formed, from nobody we serve
  std::uint64_t fragments_resent = 0;
  std::uint64_t fragments_lost = 0;  // found lost by the peer's feedback or silence
};

struct EndpointCounters {
  std::uint64_t messages_completed = 0;
  std::uint64_t messages_expired = 0;     // incomplete at their deadline
  std::uint64_t messages_superseded = 0;  // complete, but the round's stage had been served already
  std::uint64_t messages_late = 0;        // remote results after D_N
  std::uint64_t fragments_cancelled = 0;  // not (re)sent: could not arrive by the deadline
  std::uint64_t bad_messages =
      0;  // complete messages with a malformed or inconsistent round header
  std::uint64_t reassembly_refused = 0;  // fragments refused because of the memory bound
};

class Endpoint {
 public:
  // Throws std::invalid_argument naming the option.
  Endpoint(EndpointOptions options, TimePoint now);
  ~Endpoint();
  Endpoint(Endpoint&&) noexcept;
  Endpoint& operator=(Endpoint&&) noexcept;

  // --- commands
  void add_link(TimePoint now, LinkId link, const LinkInfo& info);
  void remove_link(TimePoint now, LinkId link);
  // Starts to talk to a peer that is reached at these addresses, one per link.
  PeerId connect(TimePoint now, std::span<const std::pair<LinkId, Address>> addresses);
  // A link that came (back) joins the paths to a peer we connected to; the same link again only
  // changes the address. False: no such peer, or the link was not added.
  bool add_path(TimePoint now, PeerId peer, LinkId link, const Address& address);
  // Measures the rate of a path now instead of when its evidence is old. False: no such path.
  bool request_train(TimePoint now, PeerId peer, LinkId link);
  // Stamps t0 = now. If stage 1 is a communication, submit() its message next.
  RoundRef begin_round(TimePoint now, PipelineId pipeline);
  // Plans the round's next message for variants of these sizes (and costs, if not empty), so that
  // an application encodes or computes only what will be sent. The plan is kept: a submit() of the
  // same round with as many variants carries it out, instead of planning anew, while each of its
  // links is up; variants that it does not hold may then be empty. A second call replaces it. The
  // first call also settles whether the round's first message is degraded. An empty plan where
  // submit() would accept nothing.
  Plan preview(TimePoint now, RoundRef round, std::span<const std::size_t> variant_bytes,
               MessageClass message_class, std::span<const VariantCost> costs = {},
               std::optional<PeerId> to = std::nullopt);
  // The computation of a delivered round begins now; the guard's choice of its level. `levels`:
  // from the lowest quality to the highest, not empty; `top`: the level otherwise chosen (the guard
  // kPaper steps down from it, kBudget may choose any of the first 16). `top` when the round is not
  // known. Call it when the computation really begins: what passes until submit() is learnt as its
  // run time.
  std::size_t begin_computation(TimePoint now, RoundRef round, std::span<const LevelProfile> levels,
                                std::size_t top);
  // The application hands over what the next communication of the round is to carry; if a
  // computation was going on, it ends with this call. The message goes to `to`, by default to the
  // peer that the round came from, or to the one peer there is. A message that is not accepted is
  // dropped; SubmitStatus says why. `variants`: 1 to kMaxVariants, each of at most
  // kMaxMessageBytes, else std::invalid_argument.
  SubmitStatus submit(TimePoint now, RoundRef round, Variants variants, MessageClass message_class,
                      std::optional<PeerId> to = std::nullopt);
  // The local backup of a round that began here is ready; ignored when the round is decided.
  void local_result(TimePoint now, RoundRef round, Bytes result);

  // --- inputs
  void handle_datagram(TimePoint now, const Datagram& datagram);
  void handle_timeout(TimePoint now);

  // --- outputs
  // Writes the next datagram that may leave now into `buffer` (>= kMaxDatagramBytes).
  std::optional<Transmit> poll_transmit(TimePoint now, std::span<std::byte> buffer);
  std::optional<Event> poll_event();
  std::optional<TimePoint> next_timeout() const;

  // --- getters
  std::vector<PeerId> peers() const;
  std::vector<LinkState> links(TimePoint now, PeerId peer) const;
  LinkCounters link_counters(LinkId link) const;
  EndpointCounters counters() const;
  std::size_t reassembly_bytes() const;  // memory held by incomplete messages, all peers

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron
