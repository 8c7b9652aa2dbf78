// The books that Messages keeps: of the plain messages that were accepted and whose fate is not
// known yet, and of those that have come from peers.
#pragma once

#include <bitset>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "core/base/shared_memory.h"
#include "core/base/spare_nodes.h"
#include "core/wire/plain_header.h"
#include "interneuron/few.h"
#include "interneuron/send.h"
#include "interneuron/units.h"

namespace interneuron::messages {

// Keeps the books: every message that add() takes leaves by exactly one MessageFate. Messages
// (src/core/messages/messages.h) owns one, and tells it what peers and the own sender say.
//
// A message may travel in several variants, each a message of its own to flow. It is delivered when
// the peer says that one of them was; dropped when the last of them is given up; late when one came
// late and none in time. What is still open when its time is over is settled by expire().
//
// Memory is bounded by kMaxMessages, which peers share (SharedMemory), and used again; the bytes of
// messages are held, and bounded, elsewhere. Each call takes logarithmic time. Pure;
// thread-compatible; never throws but std::bad_alloc.
class SentMessages {
 public:
  // No measurement behind this value: it only has to be more than what many peers are sent within
  // a deadline (1,000 peers at 10 Hz, 100 ms), and to bound the books.
  static constexpr std::size_t kMaxMessages = 16'384;

  struct Variant {
    MessageId message{};
    std::uint8_t variant = 0;
    // Nothing more is to come of it.
    bool over = false;
  };
  struct Entry {
    PeerId peer{};
    std::uint16_t channel = 0;
    bool newest_only = false;
    bool in_order = false;
    TimePoint t0{};
    TimePoint deadline{};
    // When a message of which nothing was heard is given up.
    TimePoint ends{};
    // The rate of a path that is looked for when a variant is given up.
    DataRate wanted{};
    Few<Variant, kMaxVariants> variants{};
  };

  // Whether one more message to this peer fits, by the rule of SharedMemory: nobody who holds up
  // the fates of its own messages keeps the books closed to others.
  bool has_room(PeerId peer) const {
    const auto held = peers_.find(peer);
    return memory_.room(held == peers_.end() ? 0 : held->second) > 0;
  }
  SendId add(const Entry& entry);

  // What happened to a variant, which travelled as this message. Messages that are not in the books
  // (any more) are ignored.
  struct When {
    // From t0; the error of that.
    Duration age{};
    Duration error{};
  };
  std::optional<MessageFate> delivered(PeerId peer, MessageId message, When when);
  std::optional<MessageFate> late(PeerId peer, MessageId message, When when);
  std::optional<MessageFate> dropped(PeerId peer, MessageId message, FateReason reason);

  // Ends a message whatever its variants do; nothing when it is not in the books.
  std::optional<MessageFate> end(SendId id, Fate fate, FateReason reason);
  // nullptr where it is not in the books.
  const Entry* find(SendId id) const;
  const Entry* find(PeerId peer, MessageId message) const;
  std::optional<SendId> id_of(PeerId peer, MessageId message) const;
  // All messages to this peer, oldest first.
  std::vector<SendId> to(PeerId peer) const;

  // A message whose Entry::ends has come.
  std::optional<SendId> ended(TimePoint now) const;
  // The smallest Entry::ends; nothing while there is no message.
  std::optional<TimePoint> first_end() const;

 private:
  using Key = std::pair<PeerId, MessageId>;
  struct Open {
    Entry entry;
    // The first variant that was late.
    std::optional<MessageFate> late;
  };
  using Entries = std::map<SendId, Open>;
  Entries::iterator at(PeerId peer, MessageId message);
  static Variant& variant_of(Open& open, MessageId message);
  MessageFate remove(Entries::iterator it, MessageFate fate);
  std::optional<MessageFate> end_variant(Entries::iterator it, MessageId message,
                                         FateReason reason);

  using ByMessage = std::map<Key, SendId>;
  using ByEnd = std::set<std::pair<TimePoint, SendId>>;
  // How many messages each peer has here.
  using Counts = std::map<PeerId, std::size_t>;

  // In messages instead of bytes.
  SharedMemory memory_{kMaxMessages};
  Entries entries_;
  ByMessage by_message_;
  ByEnd by_end_;
  Counts peers_;
  // So that a message allocates nothing here.
  SpareNodes<Entries> spare_entries_;
  SpareNodes<ByMessage> spare_by_message_;
  SpareNodes<ByEnd> spare_by_end_;
  SpareNodes<Counts> spare_peers_;
  SendId next_{1};
};

// Judges complete messages by their headers. Inbox (src/core/messages/inbox.h) owns one and asks it
// of every message that it could hand over.
//
// A message is delivered once, in whichever variant: the identifiers of each peer are remembered in
// a window of kWindow, and one that is older than that is not delivered. Of a channel where only
// the newest counts, or order, a message that is older than one delivered is superseded;
// kMaxChannels channels of a peer are remembered, and the one that was delivered on longest ago
// makes room.
//
// Headers are a peer's bytes. One that jumps ahead in its identifiers loses messages of its own
// only. Memory: about 4 KB for each peer that sends plain messages, until forget(). Pure;
// thread-compatible; never throws but std::bad_alloc.
class ReceivedMessages {
 public:
  // Senders count per peer: what 1,000 messages a second are within four seconds.
  static constexpr std::uint32_t kWindow = 4096;
  // No measurement behind this value: it only has to be more than the channels of an application
  // on which only the newest message counts.
  static constexpr std::size_t kMaxChannels = 64;

  enum class Verdict : std::uint8_t {
    kDeliver,
    // Its deadline has passed.
    kLate,
    // Another variant of it was delivered.
    kRepeated,
    // It is so much older than another one that nobody knows whether it was.
    kTooOld,
    // A newer message of its channel was delivered.
    kSuperseded,
  };
  // `age`: from t0 until now; nothing where the sender's clock is not known, then the message is
  // taken to be in time.
  Verdict look(PeerId peer, const wire::PlainHeader& header, std::optional<Duration> age) const;
  // The same; what is to be delivered counts as delivered from then on.
  Verdict judge(PeerId peer, const wire::PlainHeader& header, std::optional<Duration> age);

  // What was delivered last of a channel, or was to be and is late; nothing where that is not
  // known.
  std::optional<std::uint32_t> newest(PeerId peer, std::uint16_t channel) const;
  // A message of an ordered channel will not be delivered: those after it need not wait for it.
  void pass(PeerId peer, const wire::PlainHeader& header);
  // How far the identifier `a` is ahead of `b`, negative if behind: they wrap.
  static std::int32_t ahead(std::uint32_t a, std::uint32_t b) {
    return static_cast<std::int32_t>(a - b);
  }

  // The peer has begun a new life or is gone.
  void forget(PeerId peer) { peers_.erase(peer); }

 private:
  struct Seen {
    // The largest identifier delivered, and which of those before it were: bit i stands for
    // largest - i.
    std::optional<std::uint32_t> largest;
    std::bitset<kWindow> delivered;
    // The newest message delivered of each channel, and when: a count of deliveries.
    struct Channel {
      std::uint32_t newest = 0;
      std::uint64_t used = 0;
    };
    std::map<std::uint16_t, Channel> channels;
    std::uint64_t deliveries = 0;

    // How far behind the largest identifier this one is.
    std::uint32_t back(std::uint32_t id) const;
    void deliver(const wire::PlainHeader& header);
    void pass(const wire::PlainHeader& header);
  };
  std::map<PeerId, Seen> peers_;
};

}  // namespace interneuron::messages
