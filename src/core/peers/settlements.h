// What a peer says of whole messages that were sent to it.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <span>

#include "core/peers/path.h"
#include "core/wire/packet.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron {

struct Settled {
  enum class Kind : std::uint8_t {
    // All of its pieces are acknowledged.
    kAcknowledged,
    // The own sender gave it up: what is left of it cannot arrive in time.
    kGivenUp,
    // It is complete.
    kComplete,
    // It was complete, and dropped there: late, or not the newest of its channel.
    kDroppedThere,
    // There was no room for a piece of it.
    kRefused,
  };
  Kind kind{};
  MessageId message{};
  // Of kComplete and kDroppedThere: when it became complete.
  std::optional<PeerTime> complete_at{};
};

// Keeps what feedback tells until it is asked for. Peer owns one and feeds it every feedback that
// is meant for this session. The peer may name any message; those that were never sent, or are
// settled already, are nobody's. Grows until it is asked: by 48 messages per feedback at most.
// Pure; thread-compatible; never throws but std::bad_alloc.
class Settlements {
 public:
  // Someone asks for what is told; before that nothing is kept.
  void open() { open_ = true; }
  // A feedback came that left the peer at `left` by the own clock; nothing where the peer's clock
  // is not known. `paths`: those to the peer.
  void learn(const wire::Feedback& feedback, std::optional<TimePoint> left,
             std::span<const Path> paths);
  std::optional<Settled> poll();
  // The peer has told of every message that was complete there by this instant, unless all tellings
  // of it were lost.
  TimePoint told_until(std::span<const Path> paths) const;
  // The peer began a new life.
  void reset();

 private:
  bool open_ = false;
  std::deque<Settled> settled_;
  // When the newest feedback about all paths left the peer, and the newest about each.
  TimePoint told_all_ = TimePoint::min();
  std::map<LinkId, TimePoint> told_;
};

}  // namespace interneuron
