// What a peer says of whole messages that were sent to it.
#pragma once

#include <optional>

#include "core/base/ring.h"
#include "core/wire/packet.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::peers {

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
    // There was no room for it, or its time was over before all of it was there. That is final: it
    // is never complete.
    kRefused,
  };
  Kind kind{};
  MessageId message{};
  // When it became complete, where it is kComplete or kDroppedThere.
  std::optional<PeerTime> complete_at{};
};

// Keeps what feedback tells until it is asked for. Peer owns one and feeds it every feedback that
// is meant for this session. The peer may name any message; those that were never sent, or are
// settled already, are nobody's. That all pieces of a message are acknowledged says nothing here:
// they arrived, and what became of them only the peer knows. Grows until it is asked: by 48
// messages per feedback at most. Pure; thread-compatible; never throws but std::bad_alloc.
class Settlements {
 public:
  // Someone asks for what is told; before that nothing is kept.
  void open() { open_ = true; }
  void learn(const wire::Feedback& feedback);
  // What became complete sooner comes first, of each feedback.
  std::optional<Settled> poll();
  // The peer began a new life.
  void reset() { settled_.clear(); }

 private:
  bool open_ = false;
  Ring<Settled> settled_;
};

}  // namespace interneuron::peers
