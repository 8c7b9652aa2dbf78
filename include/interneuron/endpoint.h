// The protocol without input and output: an Endpoint turns (time, bytes) into (bytes, events). Node
// drives it with real sockets and the real clock, sim::World in virtual time; most applications use
// Node. pipeline.h says what rounds are.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "interneuron/address.h"
#include "interneuron/counters.h"
#include "interneuron/datagram.h"
#include "interneuron/endpoint_options.h"
#include "interneuron/events.h"
#include "interneuron/ledger.h"
#include "interneuron/link.h"
#include "interneuron/pipeline.h"
#include "interneuron/policy.h"
#include "interneuron/security.h"
#include "interneuron/send.h"
#include "interneuron/sizes.h"
#include "interneuron/submit_status.h"
#include "interneuron/units.h"

namespace interneuron {

// One end of all its connections: its peers and their links, the rounds that begin here and those
// that others began. Single-threaded by design (thread-compatible); owns everything in it; reads no
// clock and makes no system call.
//
// There are four kinds of call. Commands and inputs take `now`. Outputs are polled: after any call,
// drain poll_transmit() and poll_event(), then wait until next_timeout() or the next input and call
// handle_timeout(). Early or spurious calls are harmless. At one instant the order of calls is:
// arrivals, then timeouts; a result that arrives exactly at the end-to-end deadline is on time. If
// `now` goes back, the endpoint adds the difference, so that its own time never does
// (docs/paper.md, "Clock steps").
//
// Errors: std::invalid_argument for what the programmer passed (a pipeline without stages, a
// pipeline or link that does not exist); a value for what may happen at run time.
//
// What a peer may do: its bytes never throw, whatever is not used is counted and dropped, and
// memory is bounded per peer (PeerLimits) and by max_peers. At a limit only what that peer itself
// holds or sends makes room, and it sends rounds in no other name than its own. Nobody is sent more
// than he receives and asks for: an address that was not given to us is sent nothing but
// challenges, each less than three times as large as the packet that it answers, before it has
// answered one. With EndpointOptions::security all packets but those of handshakes are encrypted
// and authenticated, nothing of anybody else's is used, and only hosts that are trusted become
// peers (docs/threat_model.md). Without it packets are not authenticated: whoever overhears the
// sessions of two peers can send in the name of either.
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
  // Starts to talk to a peer that is reached at these addresses, one per link. `key`: who it is,
  // where packets are encrypted; by default the only peer that EndpointOptions::security trusts.
  // Throws std::invalid_argument where that one is not trusted or connected to already.
  PeerId connect(TimePoint now, std::span<const std::pair<LinkId, Address>> addresses,
                 const std::optional<PublicKey>& key = std::nullopt);
  // A link that came (back) joins the paths to a peer we connected to; the same link again only
  // changes the address. False when there is no such peer or the link was not added.
  bool add_path(TimePoint now, PeerId peer, LinkId link, const Address& address);
  // Measures the rate of a path now instead of when its evidence is old. False when there is no
  // such path.
  bool request_train(TimePoint now, PeerId peer, LinkId link);
  // Sends a message, in one or more variants from the best to the smallest, of which the best that
  // arrives in time is delivered (docs/messages.md, "Receiving"). Takes the bytes. Throws
  // std::invalid_argument when there is no such policy; everything else that may be wrong is in the
  // answer. Every accepted message has one MessageFate, at the latest one round trip and 50 ms
  // after its deadline.
  SendResult send(TimePoint now, PeerId peer, Variants variants, const SendOptions& options = {});
  // Many messages at once, each in one variant and with the same options, in their order. What is
  // answered is of each message; takes their bytes. A vector of Bytes alone are variants of one
  // message: say std::span(messages).
  std::vector<SendResult> send(TimePoint now, PeerId peer, std::span<Bytes> messages,
                               const SendOptions& options = {});
  // Gives up a message whose fate is not known yet: nothing more of it is sent, and its fate is
  // kDropped at once. False where its fate was told already.
  bool cancel(TimePoint now, SendId message);
  // Begins a round: t0 is `now`. If stage 1 is a communication, submit() its message next.
  RoundRef begin_round(TimePoint now, PipelineId pipeline);
  // Plans the round's next message for variants of these sizes in bytes (and costs, if not empty),
  // so that an application encodes or computes only what will be sent. The plan is kept: a submit()
  // of the same round with as many variants carries it out, instead of planning anew, while each of
  // its links is up; variants that it does not hold may then be empty. A second call replaces it.
  // The first call also settles which variant is the best one sent. An empty plan where
  // submit() would accept nothing.
  Plan preview(TimePoint now, RoundRef round, std::span<const std::size_t> variant_bytes,
               MessageClass message_class, std::span<const VariantCost> costs = {},
               std::optional<PeerId> to = std::nullopt);
  // The computation of a delivered round begins now. Gives the level that the guard chooses: an
  // index into `levels`, which go from the lowest quality to the highest and are not empty. `top`
  // is the level to take if nothing speaks against it: the guard kPaper steps down from it, kBudget
  // may choose any of the first 16. Gives `top` when the round is not known. Call it when the
  // computation really begins, because what passes until submit() is learnt as its run time.
  std::size_t begin_computation(TimePoint now, RoundRef round, std::span<const LevelProfile> levels,
                                std::size_t top);
  // The application hands over what the next communication of the round is to carry; if a
  // computation was going on, it ends with this call. The message goes to `to`, by default to the
  // peer that the round came from, or to the one peer there is. A message that is not accepted is
  // dropped; SubmitStatus says why. `variants`: 1 to kMaxVariants, each of at most
  // kMaxMessageBytes, else std::invalid_argument.
  SubmitStatus submit(TimePoint now, RoundRef round, Variants variants, MessageClass message_class,
                      std::optional<PeerId> to = std::nullopt);
  // The local result of a round that began here is ready; ignored when the round is decided.
  void local_result(TimePoint now, RoundRef round, Bytes result);
  // No remote result will come for a round that began here: whoever was to compute it has said so.
  // The round is missed, and answered as soon as its local result is there instead of at the
  // deadline. Ignored when the round is decided.
  void give_up(TimePoint now, RoundRef round);

  // Takes a list of revocations that an authority has signed and that is newer than the one there
  // is, as peers hand it on: RevocationsChanged tells of those. False: it is none.
  bool take_revocations(TimePoint now, ByteView list);

  // --- inputs
  void handle_datagram(TimePoint now, const Datagram& datagram);
  void handle_timeout(TimePoint now);

  // --- outputs
  // Writes the next datagram that may leave now into `buffer`, which must hold kMaxDatagramBytes.
  std::optional<Transmit> poll_transmit(TimePoint now, std::span<std::byte> buffer);
  // The same, but leaves the bytes of a message where they are.
  std::optional<TransmitParts> poll_transmit_parts(TimePoint now, std::span<std::byte> buffer);
  std::optional<Event> poll_event();
  // Only of the door of several endpoints; ask after each datagram until nothing comes.
  std::optional<HandedOn> poll_handed_on();
  // When handle_timeout() or poll_transmit() has something to do; nothing: not before an input.
  std::optional<TimePoint> next_timeout() const;

  // --- getters
  std::vector<PeerId> peers() const;
  // What is believed now of each link towards the peer; empty for a peer that is not known.
  std::vector<LinkState> links(TimePoint now, PeerId peer) const;
  LinkCounters link_counters(LinkId link) const;
  EndpointCounters counters() const;
  // Pieces that the message lacks still of which the last datagram has brought one. 0: it was whole
  // then, or the datagram brought something else; whoever waits for that should not wait longer.
  std::size_t missing_pieces() const;
  // Bytes held by incomplete messages of all peers.
  std::size_t reassembly_bytes() const;
  // What this peer holds here and what has struck it; all zero for a peer that is not known.
  PeerLedger ledger(PeerId peer) const;
  // Bytes held by messages under way to all peers.
  std::size_t sending_bytes() const;
  // The time of day, in ns since 1970, that this endpoint goes by where packets are encrypted: the
  // largest of what it was given, what it has said and what hosts have said that it connected to.
  // Keep it for the next start (Security::unix_time_ns). 0 in the clear.
  std::int64_t unix_time_ns(TimePoint now) const;
  // What the host's clock says of it, which may have been set since: counts where it is later.
  void raise_unix_time_ns(TimePoint now, std::int64_t unix_time_ns);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron
