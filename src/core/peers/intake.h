// What a peer sends, and what comes of it: messages of its own (Intake), and what it says of those
// that were sent to it (Settlements).
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "core/base/rate_limit.h"
#include "core/base/ring.h"
#include "core/flow/arrivals.h"
#include "core/flow/reassembler.h"
#include "core/flow/windows.h"
#include "core/peers/feedback_due.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::peers {

// What a peer says of a whole message that was sent to it.
struct Settled {
  enum class Kind : std::uint8_t {
    // The own sender gave it up: what is left of it cannot arrive in time.
    kGivenUp,
    // It was not complete at its deadline.
    kIncomplete,
    // It is complete.
    kComplete,
    // It was complete, and dropped there: late, or not the newest of its channel.
    kDroppedThere,
    // It is complete, and kept there for a better variant.
    kKept,
    // There was no room for it, or its time was over before all of it was there. That is final: it
    // is never complete.
    kRefused,
  };
  Kind kind{};
  MessageId message{};
  // When it became complete, where it is kComplete, kDroppedThere or kKept.
  std::optional<PeerTime> complete_at{};
};

// Keeps what feedback tells until it is asked for. Peer owns one and feeds it every feedback that
// is meant for this session. The peer may name any message; those that were never sent, or are
// settled already, are nobody's. That all pieces of a message are acknowledged says nothing here:
// they arrived, and what became of them only the peer knows. Grows until it is asked: by 48
// messages per feedback at most. Pure; thread-compatible; never throws but std::bad_alloc.
class Settlements {
 public:
  explicit Settlements(bool open = false) : open_(open) {}
  // Someone asks for what is told; before that nothing is kept.
  void open() { open_ = true; }
  void learn(const wire::Feedback& feedback);
  // What became complete sooner comes first, of each feedback.
  std::optional<Settled> poll();
  // The peer began a new life; whoever asks goes on asking.
  void reset() { *this = Settlements(open_); }

 private:
  bool open_;
  Ring<Settled> settled_;
};

// What has become of a packet of a peer's, or of a piece that was computed.
struct PacketOutcome {
  // The packet had come before, or is too old to tell; it was dropped.
  bool duplicate = false;
  // The peer sends more packets than it may; this one was dropped.
  bool limited = false;
  // The peer has heard us for the first time: the round trip works.
  bool became_ready = false;
  bool clock_stepped = false;
  // A piece of a message was dropped for want of memory.
  bool refused = false;
  // A piece was dropped that contradicts others of its message.
  bool bad_piece = false;
  // Pieces that the message lacks still of which this packet has brought one.
  std::size_t missing = 0;
  // The message that this packet completed, and what it begins with.
  std::optional<wire::MessageBytes> message;
  MessageId message_id{};
  wire::MessageKind kind{};
};

// What a peer sends: pieces become messages within its limits, what strikes these is kept in its
// ledger, and what is to be told of what came is kept until feedback tells it.
//
// Owned and fed by Peer with what its packets hold, each once. A peer may send anything: messages
// that are larger than they may be are refused with their first piece, incomplete ones are held in
// bounded memory, and more packets or messages a second than it may send are dropped. Pure;
// thread-compatible.
class Intake {
 public:
  Intake(const PeerLimits& limits, TimePoint now);
  // The peer has begun a new session.
  void reset();

  // Whether the peer may send one packet more; else it is dropped, and a limit has struck.
  bool may_come(TimePoint now);
  // Puts a piece into its message. False where it is not wanted. `clocks`: see
  // flow::Reassembler::add(). `room`: how many bytes a message that begins with it may take.
  bool take_piece(TimePoint now, const wire::Data& data, const flow::ClockBounds& clocks,
                  std::size_t room, PacketOutcome& outcome);
  // What computes pieces that never came: a piece that was wanted, or a window symbol.
  void remember(const wire::Data& data) { windows_.piece(data); }
  void remember(TimePoint now, const wire::Window& window, std::size_t room) {
    windows_.symbol(now, window, room);
  }
  // A piece that was computed, for take_piece(); ask until nothing comes. Whether there may be one.
  std::optional<wire::Data> poll_computed() { return windows_.poll(); }
  bool has_computed() const { return windows_.has_computed(); }

  // Returns how many incomplete messages were given up.
  std::size_t handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout() const;

  // A limit has struck this peer; kept in its ledger.
  void strike(TimePoint now, PeerLimit limit);
  // A limit that the application is to be told of: the first that struck in a second.
  std::optional<PeerLimit> take_limited() { return std::exchange(limited_, std::nullopt); }
  // What the peer holds here, as far as it is known here, and what has struck it.
  PeerLedger ledger() const;
  std::size_t bytes() const { return reassembler_.bytes() + windows_.bytes(); }
  // The application may have been told of the peer: it has sent a whole message or was limited.
  bool is_known() const { return is_known_; }

  // What is to be told of whole messages, and when of packets.
  flow::Receipts receipts;
  FeedbackDue feedback;

 private:
  // Whether a piece is of a message that is larger than messages of its kind may be.
  bool is_too_large(const wire::Data& data) const;
  // Nothing of the message that this is a piece of is wanted.
  void refuse(TimePoint now, const wire::FragmentHeader& fragment, PeerLimit why,
              PacketOutcome& outcome);
  // Messages that the reassembler has forgotten incomplete are to be told of.
  void tell_forgotten(TimePoint now);

  PeerLimits limits_;
  flow::Reassembler reassembler_;
  flow::WindowReceiver windows_;
  RateLimit packet_limit_;
  RateLimit message_limit_;
  PeerLedger ledger_;
  std::optional<PeerLimit> limited_;
  // When the next limit is told of.
  TimePoint tell_limit_at_ = TimePoint::min();
  bool is_known_ = false;
};

}  // namespace interneuron::peers
