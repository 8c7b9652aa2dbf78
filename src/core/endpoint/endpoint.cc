// Joins the machines below it, with one queue of events and one time; what types say in words.
#include "interneuron/endpoint.h"

#include <algorithm>
#include <deque>

#include "core/base/ablation.h"
#include "core/base/earliest.h"
#include "core/base/held_memory.h"
#include "core/messages/messages.h"
#include "core/peers/peers.h"
#include "core/plan/policies.h"
#include "core/rounds/rounds.h"

namespace interneuron {
namespace {

// Datagrams that are read together came so far apart at the most. No measurement behind this value:
// it is a millisecond of a message's time at the worst by which what falls due among them is late.
constexpr Duration kTogether = std::chrono::milliseconds(1);
// How far apart packets of other versions are told of. No measurement behind this value: it only
// has to be short for a person who waits, and long for a log.
constexpr Duration kBetweenVersions = std::chrono::seconds(10);

template <class Value>
std::optional<Value> pop(std::deque<Value>& queue) {
  if (queue.empty()) return std::nullopt;
  Value front = std::move(queue.front());
  queue.pop_front();
  return front;
}

Secret secret_of(const EndpointOptions& options) {
  return options.secret != Secret{} ? options.secret : Secret{options.session.value, 0};
}

// The endpoint's own time. It never goes back: where the host's time does, the difference is added
// from then on (docs/paper.md, "Clock steps"). Everything inside an endpoint is in its own time,
// and only next_timeout() is told in the host's. Pure; thread-compatible.
class OwnTime {
 public:
  explicit OwnTime(TimePoint host) : newest_(host) {}

  // The host's time is `host` now. Returns the own time of this instant.
  TimePoint tick(TimePoint host) {
    if (host < newest_) shift_ += newest_ - host;
    newest_ = host;
    return own(host);
  }
  // The own time of the last tick().
  TimePoint now() const { return own(newest_); }
  // From one to the other, as the difference is now.
  TimePoint own(TimePoint host) const { return host + shift_; }
  TimePoint host(TimePoint own) const { return own - shift_; }

 private:
  // The host's time at the last tick().
  TimePoint newest_;
  // The own time less the host's.
  Duration shift_{};
};

}  // namespace

// Joins the peers (packets), the rounds and the plain messages, with one queue of events and one
// time. It has no logic of its own: it hands inputs on, merges timeouts and counters, and keeps the
// order in which things happen at one instant.
class Endpoint::Impl {
 public:
  Impl(const EndpointOptions& options, TimePoint now)
      : peers_({.self = options.session,
                .accept = options.accept_peers,
                .max_unannounced = options.max_peers,
                .repair = !options.ablation || options.ablation->repair,
                .started = now,
                .limits = options.peer_limits,
                .secret = secret_of(options),
                .reassembly_budget_bytes = options.reassembly_budget_bytes,
                .send_budget_bytes = options.send_budget_bytes,
                .security = options.security,
                .shard = options.shard}),
        policies_(options.policies),
        held_(options.shard),
        rounds_(options, policies_, peers_, held_, events_),
        messages_(policies_, peers_, held_, options.peer_limits, events_),
        time_(now) {}

  // Every call tells the time. Those that look at rounds first do what is due.
  TimePoint tick(TimePoint host) { return time_.tick(host); }
  TimePoint advance(TimePoint host) {
    const TimePoint now = tick(host);
    run_timers(now);
    return now;
  }

  peers::Peers& peers() { return peers_; }
  rounds::Rounds& rounds() { return rounds_; }
  messages::Messages& messages() { return messages_; }
  const OwnTime& time() const { return time_; }
  std::deque<HandedOn>& handed_on() { return handed_on_; }
  std::size_t missing_pieces() const { return missing_pieces_; }

  void remove_link(TimePoint now, LinkId link) {
    for (PathChanged& change : peers_.remove_link(now, link)) {
      events_.emplace_back(std::move(change));
    }
  }

  void handle_datagram(TimePoint now, const Datagram& datagram) {
    // What was due before this instant is done before; what is due at it is done after, because
    // arrivals come first. Among datagrams that are read together only what was known before
    // counts.
    if (const TimePoint to = now - Duration{1}; is_due(to)) run_timers(to);
    peers::Peers::Received received = peers_.receive(now, datagram);
    missing_pieces_ = received.outcome.missing;
    if (received.shard != 0) {
      handed_on_.push_back({received.shard, datagram.link, datagram.from, datagram.ecn,
                            Bytes(datagram.bytes.begin(), datagram.bytes.end())});
    }
    tell_lost();
    while (const auto key = peers_.gate().poll_shared_key()) events_.emplace_back(KeyShared{*key});
    if (received.other_version && now >= tell_version_at_) {
      tell_version_at_ = now + kBetweenVersions;
      events_.emplace_back(OtherVersion{datagram.link, datagram.from, *received.other_version});
    }
    if (received.peer == nullptr) return;
    if (received.restarted) {
      rounds_.forget(received.peer->identity().id);
      messages_.forget(received.peer->identity().id);
      events_.emplace_back(PeerRestarted{received.peer->identity().id});
    }
    if (received.outcome.limited) return tell_limited(*received.peer);
    if (received.outcome.duplicate) return;
    const PeerId id = received.peer->identity().id;
    react(now, *received.peer, received.outcome);
    // Whoever has sent a list of revocations may be gone after each of them.
    while (peers_.access(now, id) == received.peer) {
      auto computed = peers_.receive_computed(now, *received.peer);
      if (!computed) break;
      react(now, *received.peer, *computed);
    }
  }

  std::optional<Event> poll_event() { return pop(events_); }
  // The peer that has sent the list, if one has, may be among those that are gone after it.
  bool take_revocations(ByteView list) {
    const bool is_newer = peers_.take_revocations(list);
    tell_lost();
    return is_newer;
  }

  std::optional<TimePoint> next_timeout() const {
    const TimePoint now = time_.now();
    std::optional<TimePoint> next =
        earliest(rounds_.next_timeout(), messages_.next_timeout(), peers_.next_timeout(now));
    // What should have been done before is due now. Peers' bytes may make an instant of any value.
    if (next) *next = time_.host(std::max(*next, now));
    return next;
  }

  PeerLedger ledger(PeerId peer) const {
    PeerLedger out = peers_.ledger(peer);
    rounds_.fill(peer, out);
    out.held_messages = held_.count(peer);
    out.held_bytes = held_.bytes(peer);
    return out;
  }

  EndpointCounters counters() const {
    EndpointCounters out = rounds_.counters();
    const EndpointCounters& plain = messages_.counters();
    out.messages_completed += plain.messages_completed;
    out.messages_superseded += plain.messages_superseded;
    out.messages_late += plain.messages_late;
    out.bad_messages += plain.bad_messages;
    out.messages_expired = messages_expired_;
    out.reassembly_refused = reassembly_refused_;
    out.bad_fragments = bad_fragments_;
    out.fragments_cancelled = peers_.cancelled();
    return out;
  }

 private:
  bool is_due(TimePoint now) const {
    const auto next = earliest(rounds_.next_timeout(), messages_.next_timeout());
    return ran_to_ + kTogether <= now || peers_.was_due(now) || (next && *next <= now);
  }
  // Does all that is due at or before `now`: the rounds and messages first, then the peers.
  void run_timers(TimePoint now) {
    ran_to_ = now;
    rounds_.expire(now);
    messages_.expire(now);
    peers::Peers::Expired expired = peers_.handle_timeout(now);
    messages_expired_ += expired.messages;
    messages_.collect(now, expired.failed);
    for (PathChanged& change : expired.changes) events_.emplace_back(std::move(change));
    tell_lost();
  }

  void tell_lost() {
    while (const auto lost = peers_.poll_lost()) {
      rounds_.forget(lost->id);
      messages_.forget(lost->id);
      if (lost->was_known) events_.emplace_back(PeerLost{lost->id});
    }
  }

  void react(TimePoint now, peers::Peer& peer, peers::Peer::Outcome& outcome) {
    const PeerId id = peer.identity().id;
    if (outcome.became_ready) events_.emplace_back(PeerReady{id});
    if (outcome.clock_stepped) rounds_.forget_clock(id);
    if (outcome.refused) ++reassembly_refused_;
    if (outcome.bad_piece) ++bad_fragments_;
    while (auto change = peer.paths().poll_change()) events_.emplace_back(std::move(*change));
    if (outcome.message && outcome.kind == wire::MessageKind::kRound) {
      rounds_.complete(now, peer, std::move(*outcome.message));
    } else if (outcome.message && outcome.kind == wire::MessageKind::kRevocations) {
      Bytes list = std::move(outcome.message->payload);
      if (take_revocations(list)) events_.emplace_back(RevocationsChanged{std::move(list)});
      return;
    } else if (outcome.message) {
      messages_.complete(now, peer, outcome.message_id, std::move(*outcome.message));
    }
    messages_.collect(now, peer);
    tell_limited(peer);
  }

  void tell_limited(peers::Peer& peer) {
    const auto limit = peer.intake().take_limited();
    if (limit) events_.emplace_back(PeerLimited{peer.identity().id, *limit});
  }

  std::deque<Event> events_;
  std::deque<HandedOn> handed_on_;
  peers::Peers peers_;
  plan::PolicyRegistry policies_;
  HeldMemory held_;
  rounds::Rounds rounds_;
  messages::Messages messages_;
  OwnTime time_;
  // What was due until then has been done.
  TimePoint ran_to_ = TimePoint::min();
  std::size_t missing_pieces_ = 0;
  std::uint64_t messages_expired_ = 0;
  std::uint64_t reassembly_refused_ = 0;
  std::uint64_t bad_fragments_ = 0;
  // When the next packet of another version is told of.
  TimePoint tell_version_at_ = TimePoint::min();
};

Endpoint::Endpoint(EndpointOptions options, TimePoint now)
    : impl_(std::make_unique<Impl>(options, now)) {}
Endpoint::~Endpoint() = default;
Endpoint::Endpoint(Endpoint&&) noexcept = default;
Endpoint& Endpoint::operator=(Endpoint&&) noexcept = default;

void Endpoint::add_link(TimePoint, LinkId link, const LinkInfo& info) {
  impl_->peers().add_link(link, info);
}
void Endpoint::remove_link(TimePoint now, LinkId link) {
  impl_->remove_link(impl_->tick(now), link);
}
PeerId Endpoint::connect(TimePoint now, std::span<const std::pair<LinkId, Address>> addresses,
                         const std::optional<PublicKey>& key) {
  return impl_->peers().connect(impl_->tick(now), addresses, key);
}
SendResult Endpoint::send(TimePoint now, PeerId peer, Variants variants,
                          const SendOptions& options) {
  return impl_->messages().send(impl_->advance(now), peer, std::move(variants), options);
}
std::vector<SendResult> Endpoint::send(TimePoint now, PeerId peer, std::span<Bytes> messages,
                                       const SendOptions& options) {
  const TimePoint own = impl_->advance(now);
  std::vector<SendResult> out;
  out.reserve(messages.size());
  for (Bytes& message : messages) {
    Variants variants;
    variants.push_back(std::move(message));
    out.push_back(impl_->messages().send(own, peer, std::move(variants), options));
  }
  return out;
}
bool Endpoint::cancel(TimePoint now, SendId message) {
  return impl_->messages().cancel(impl_->advance(now), message);
}
RoundRef Endpoint::begin_round(TimePoint now, PipelineId pipeline) {
  return impl_->rounds().begin(impl_->advance(now), pipeline);
}
bool Endpoint::add_path(TimePoint now, PeerId peer, LinkId link, const Address& address) {
  return impl_->peers().add_path(impl_->tick(now), peer, link, address);
}
bool Endpoint::request_train(TimePoint now, PeerId peer, LinkId link) {
  return impl_->peers().request_train(impl_->tick(now), peer, link);
}
SubmitStatus Endpoint::submit(TimePoint now, RoundRef round, Variants variants,
                              MessageClass message_class, std::optional<PeerId> to) {
  return impl_->rounds().submit(impl_->advance(now), round, std::move(variants), message_class, to);
}
Plan Endpoint::preview(TimePoint now, RoundRef round, std::span<const std::size_t> variant_bytes,
                       MessageClass message_class, std::span<const VariantCost> costs,
                       std::optional<PeerId> to) {
  return impl_->rounds().preview(impl_->advance(now), round, variant_bytes, message_class, costs,
                                 to);
}
std::size_t Endpoint::begin_computation(TimePoint now, RoundRef round,
                                        std::span<const LevelProfile> levels, std::size_t top) {
  return impl_->rounds().begin_computation(impl_->advance(now), round, levels, top);
}
void Endpoint::local_result(TimePoint now, RoundRef round, Bytes result) {
  impl_->rounds().local_result(impl_->advance(now), round, std::move(result));
}
void Endpoint::give_up(TimePoint now, RoundRef round) {
  impl_->rounds().give_up(impl_->advance(now), round);
}
void Endpoint::handle_datagram(TimePoint now, const Datagram& datagram) {
  impl_->handle_datagram(impl_->tick(now), datagram);
}
void Endpoint::handle_timeout(TimePoint now) { impl_->advance(now); }
std::optional<Transmit> Endpoint::poll_transmit(TimePoint now, std::span<std::byte> buffer) {
  const auto parts = poll_transmit_parts(now, buffer);
  return parts ? std::optional(parts->join(buffer)) : std::nullopt;
}
std::optional<TransmitParts> Endpoint::poll_transmit_parts(TimePoint now,
                                                           std::span<std::byte> buffer) {
  return impl_->peers().poll(impl_->tick(now), buffer);
}
std::optional<Event> Endpoint::poll_event() { return impl_->poll_event(); }
std::optional<TimePoint> Endpoint::next_timeout() const { return impl_->next_timeout(); }
std::optional<HandedOn> Endpoint::poll_handed_on() { return pop(impl_->handed_on()); }
bool Endpoint::take_revocations(TimePoint now, ByteView list) {
  impl_->tick(now);
  return impl_->take_revocations(list);
}
std::vector<PeerId> Endpoint::peers() const { return impl_->peers().ids(); }
std::vector<LinkState> Endpoint::links(TimePoint now, PeerId peer) const {
  return impl_->peers().links(impl_->time().own(now), peer);
}
LinkCounters Endpoint::link_counters(LinkId link) const { return impl_->peers().counters(link); }
EndpointCounters Endpoint::counters() const { return impl_->counters(); }
PeerLedger Endpoint::ledger(PeerId peer) const { return impl_->ledger(peer); }
std::size_t Endpoint::missing_pieces() const { return impl_->missing_pieces(); }
std::size_t Endpoint::reassembly_bytes() const { return impl_->peers().reassembly_bytes(); }
std::int64_t Endpoint::unix_time_ns(TimePoint now) const {
  return impl_->peers().gate().unix_ns(impl_->time().own(now));
}
void Endpoint::raise_unix_time_ns(TimePoint now, std::int64_t unix_time_ns) {
  impl_->peers().gate().raise_unix_ns(impl_->tick(now), unix_time_ns);
}
std::size_t Endpoint::sending_bytes() const { return impl_->peers().sending_bytes(); }

std::string_view to_string(PeerLimit limit) {
  switch (limit) {
    case PeerLimit::kContexts:
      return "contexts";
    case PeerLimit::kPipelines:
      return "pipelines";
    case PeerLimit::kHeldMessages:
      return "held";
    case PeerLimit::kDeadline:
      return "deadline";
    case PeerLimit::kReassembly:
      return "reassembly";
    case PeerLimit::kMessageSize:
      return "message size";
    case PeerLimit::kPacketRate:
      return "packet rate";
    case PeerLimit::kMessageRate:
      return "message rate";
    case PeerLimit::kOrigin:
      return "origin";
  }
  return "?";
}

std::string_view to_string(SubmitStatus status) {
  switch (status) {
    case SubmitStatus::kAccepted:
      return "accepted";
    case SubmitStatus::kUnknownRound:
      return "unknown round: it was not begun or delivered here lately";
    case SubmitStatus::kRoundOver:
      return "round over: it was handed over before, was answered, or its time has passed";
    case SubmitStatus::kNoWayToOrigin:
      return "no way to the origin: the pipeline has no communication left to carry the result";
    case SubmitStatus::kNoPeer:
      return "no peer: the one named is not known, or none was named and there is not exactly one";
    case SubmitStatus::kNoLink:
      return "no link: none to the peer is up, or the policy named only links that are not";
    case SubmitStatus::kOverBudget:
      return "over budget: the messages under way hold as many bytes as they may";
    case SubmitStatus::kRefusedByPolicy:
      return "refused by the policy: see the reason in the plan";
  }
  return "?";
}

}  // namespace interneuron
