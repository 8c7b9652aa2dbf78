// What peers' complete plain messages come to: the application is handed each once, in the best of
// its variants that is whole by its deadline, or not at all.
//
// Messages owns one. Which variants wait for a better one the sender says, by its policy's merge();
// what waits is kept until shortly before the deadline that its header states, by what is known of
// the sender's clock, and handed over at once while that is not known. A peer that promises better
// variants and never sends them delays its own messages alone: they are held in memory that is
// bounded for each peer (HeldMemory, PeerLimits::held_messages), and what finds no room is handed
// over at once. Messages of an ordered channel wait for those before them as long as their sender
// says, and where they find no room, those that are missing are passed over. Pure;
// thread-compatible.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/base/held_memory.h"
#include "core/messages/books.h"
#include "core/peers/peers.h"
#include "core/wire/message_bytes.h"
#include "core/wire/plain_header.h"
#include "interneuron/counters.h"
#include "interneuron/events.h"
#include "interneuron/ledger.h"

namespace interneuron::messages {

class Inbox {
 public:
  // What is kept is handed over so long before its deadline, so that a loop that wakes up late is
  // not too late. No measurement behind this value: it is several turns of an event loop, and short
  // against the deadlines of messages.
  static constexpr Duration kHandOver = std::chrono::milliseconds(1);

  // What is handed over is appended to `events`; it, `peers` and `memory` must outlive this.
  Inbox(peers::Peers& peers, std::deque<Event>& events, HeldMemory& memory,
        const PeerLimits& limits)
      : peers_(peers), events_(events), memory_(memory), limits_(limits) {}

  // A message of this peer is complete.
  void complete(TimePoint now, peers::Peer& peer, MessageId message, wire::MessageBytes bytes);
  // Hands over what was kept and is due at or before `now`.
  void expire(TimePoint now);
  std::optional<TimePoint> next_timeout() const;
  // The peer has begun a new life or is gone.
  void forget(PeerId peer);

  // Those about complete messages; the others are 0.
  const EndpointCounters& counters() const { return counters_; }

 private:
  // A complete variant of a message.
  struct Arrived {
    PeerId from{};
    MessageId message{};
    wire::PlainHeader header;
    Bytes payload;
    // When it was complete.
    TimePoint at{};
    // It was kept since, and the peer was told so.
    bool was_kept = false;
    TimePoint until{};
  };
  // All variants of a message have the same.
  using Key = std::pair<PeerId, std::uint32_t>;
  using Kept = std::map<Key, Arrived>;
  // How old a message is, and how wrong that may be; nothing while the sender's clock is not known.
  struct Age {
    Duration age{};
    Duration error{};
  };
  static std::optional<Age> age_of(TimePoint now, peers::Peer& peer,
                                   const wire::PlainHeader& header);
  bool keep(TimePoint now, peers::Peer& peer, const std::optional<Age>& age, Arrived& arrived);
  void settle(TimePoint now, peers::Peer& peer, Arrived arrived);
  void hand_over(TimePoint now, peers::Peer& peer, Arrived arrived);
  Arrived take(Kept::iterator it);

  // What waits in an ordered channel of a peer, in the order of sending.
  using Channel = std::pair<PeerId, std::uint16_t>;
  using Queue = std::deque<Arrived>;
  bool must_wait(const Arrived& arrived) const;
  bool queue(TimePoint now, peers::Peer& peer, const std::optional<Age>& age, Arrived& arrived);
  Arrived take_first(const Channel& channel, Queue& queue);
  void release(TimePoint now, peers::Peer& peer, const Channel& channel,
               std::optional<std::uint32_t> up_to);

  peers::Peers& peers_;
  std::deque<Event>& events_;
  HeldMemory& memory_;
  PeerLimits limits_;
  ReceivedMessages received_;
  Kept kept_;
  // By when they are handed over.
  std::set<std::pair<TimePoint, Key>> due_;
  std::map<Channel, Queue> queues_;
  struct QueueDue {
    TimePoint until{};
    Channel channel{};
    std::uint32_t id = 0;
    friend auto operator<=>(const QueueDue&, const QueueDue&) = default;
  };
  std::set<QueueDue> queues_due_;
  EndpointCounters counters_;
};

}  // namespace interneuron::messages
