// The plain messages of an endpoint, both ways: from send() to the fate, and from a peer's complete
// message to the application. Joins SentMessages (what was sent) and Inbox (what has come) with the
// policies and the peers.
//
// Owned by Endpoint, which feeds it the application's commands, the complete messages of peers and
// the passing of time. Messages are any bytes: one with a malformed header is counted and dropped.
// Memory is bounded by SentMessages, Inbox and kMaxWaiting. Pure; thread-compatible.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "core/dispatch/routes.h"
#include "core/messages/books.h"
#include "core/messages/inbox.h"
#include "core/messages/on_time_forecast.h"
#include "core/peers/peers.h"
#include "core/plan/policies.h"
#include "interneuron/endpoint.h"

namespace interneuron::messages {

class Messages {
 public:
  // What happens is appended to `events`; it, `policies`, `peers` and `held` must outlive this.
  Messages(const plan::PolicyRegistry& policies, peers::Peers& peers, HeldMemory& held,
           const PeerLimits& limits, std::deque<Event>& events);

  // The commands of Endpoint, in its own time. Throws std::invalid_argument when there is no such
  // policy.
  SendResult send(TimePoint now, PeerId to, Variants variants, const SendOptions& options);
  bool cancel(TimePoint now, SendId id);

  // A message of this peer is complete.
  void complete(TimePoint now, peers::Peer& peer, MessageId message, wire::MessageBytes bytes) {
    inbox_.complete(now, peer, message, std::move(bytes));
  }
  // Takes in what this peer, or the sender to it, has to say of messages.
  void collect(TimePoint now, peers::Peer& peer);
  void collect(TimePoint now, std::span<const PeerId> peers);
  // What is due at or before `now`.
  void expire(TimePoint now);
  std::optional<TimePoint> next_timeout() const;
  // The peer has begun a new life, or is gone: nothing that was sent to it will be told of.
  void forget(PeerId peer);

  // Those about complete messages; the others are 0.
  const EndpointCounters& counters() const { return inbox_.counters(); }

 private:
  // The channel of a message that was refused, which `options` name.
  struct Waiting {
    PeerId peer{};
    dispatch::Sizes sizes;
    SendOptions options;
    TimePoint since{};
  };
  // Channels that are told when they can send again. No measurement behind this value: it only has
  // to bound what is looked at every kRecheck.
  static constexpr std::size_t kMaxWaiting = 64;

  std::uint32_t next_id(TimePoint now, const peers::Peer& peer);
  wire::PlainHeader header_of(TimePoint now, const peers::Peer& peer, const SendOptions& options);
  std::uint16_t back_to_last(PeerId peer, std::uint16_t channel, std::uint32_t id);
  SendResult plan(TimePoint now, peers::Peer& peer, const Policy& policy, const Links& links,
                  std::span<const std::size_t> sizes, const SendOptions& options,
                  dispatch::Routes& routes) const;
  void supersede(TimePoint now, PeerId peer, std::uint16_t channel);
  void wait(const Waiting& channel);
  bool would_accept(TimePoint now, const Waiting& waiting);
  void settle(TimePoint now, peers::Peer& peer, const peers::Settled& settled);
  void note_kept(peers::Peer& peer, const SentMessages::Entry& entry, MessageId message,
                 const SentMessages::When& when);
  void report(std::optional<MessageFate> fate);
  void stop(peers::Peer& peer, const SentMessages::Entry& entry);

  const plan::PolicyRegistry& policies_;
  peers::Peers& peers_;
  std::deque<Event>& events_;
  SentMessages sent_;
  Inbox inbox_;
  OnTimeForecasts forecasts_;
  std::vector<Waiting> waiting_;
  // What the next message to each peer is called on its way.
  std::map<PeerId, std::uint32_t> next_ids_;
  // The last message of each ordered channel to each peer, ReceivedMessages::kMaxChannels of them.
  std::map<PeerId, std::map<std::uint16_t, std::uint32_t>> last_ordered_;
  // When it is checked again whether the channels that wait can send; nothing while none waits.
  std::optional<TimePoint> recheck_at_;
};

}  // namespace interneuron::messages
