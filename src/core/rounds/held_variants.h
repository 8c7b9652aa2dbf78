// The messages that wait for a better variant of themselves.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/shared_memory.h"
#include "core/dispatch/round.h"
#include "core/guard/stage_guard.h"
#include "interneuron/units.h"

namespace interneuron::rounds {

// A complete message, taken apart.
struct Arrived {
  dispatch::Round round;
  Bytes payload;
  PeerId from{};
};

// A message that waits, or whose time is over.
struct Held {
  Arrived arrived;
  guard::StageGuard::Hold hold;
};

// Keeps the messages of each peer apart: a peer may have a limited number that wait, and of the
// memory for all of them only what leaves room for others (SharedMemory). Stages owns one, and
// serves at once what finds no room. A peer that fills its part makes only its own messages be
// served in the variant that comes first. Pure; thread-compatible.
class HeldVariants {
 public:
  // What the messages of all peers may hold, in bytes: 16 of the largest half of a raw frame
  // (4 MB). No measurement behind this value.
  static constexpr std::size_t kBudgetBytes = std::size_t{64} * 1024 * 1024;

  // The message of this peer that waits for the end of the same stage of the same round; else
  // nullptr.
  const Held* find(PeerId peer, const dispatch::Round& round) const;
  // Whether one more message of `bytes` bytes may wait where the peer may have `most` messages.
  bool has_room(PeerId peer, std::size_t bytes, std::size_t most) const;
  void add(Held held);
  // The stage that the round is in is over: nothing of this peer waits for it any more.
  void drop(PeerId peer, const dispatch::Round& round);
  // Nor of any other peer; looks at every message that waits.
  void drop(const dispatch::Round& round);
  // Takes the messages whose time is over at `now`, in the order of their time.
  std::vector<Held> release(TimePoint now);
  // When the next one's time is over.
  std::optional<TimePoint> next_timeout() const;
  // The peer is gone, or has begun a new session.
  void forget(PeerId peer);

  std::size_t count(PeerId peer) const;
  std::size_t bytes(PeerId peer) const;

 private:
  // By their time and, of equal ones, in the order in which they came.
  using Key = std::pair<TimePoint, std::uint64_t>;
  using Waiting = std::map<Key, Held>;
  struct OfPeer {
    std::vector<Key> keys;
    std::size_t bytes = 0;
  };
  Held take(Waiting::iterator it);
  template <class Which>
  void drop_of(PeerId peer, const Which& which);

  Waiting waiting_;
  // The peers of which something waits.
  std::map<PeerId, OfPeer> peers_;
  SharedMemory memory_{kBudgetBytes};
  std::uint64_t added_ = 0;
};

}  // namespace interneuron::rounds
