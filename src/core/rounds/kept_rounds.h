// What an endpoint keeps of rounds in progress: those that the application works on, between two
// communications (Contexts), and messages that wait for a better variant (HeldVariants).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "core/base/held_memory.h"
#include "core/dispatch/round.h"
#include "core/guard/stage_guard.h"
#include "interneuron/guard.h"
#include "interneuron/policy.h"
#include "interneuron/round.h"
#include "interneuron/units.h"

namespace interneuron::rounds {

// The plan that preview() has answered, which submit() carries out.
struct Previewed {
  Plan plan;
  // How many variants it was made for.
  std::size_t variants = 0;

  // Whether a message of `count` variants can still be sent by this plan.
  bool fits(std::size_t count, std::span<const LinkState> links) const;
};

// A round that the application works on here, between two communications.
struct RoundContext {
  // As it came in; at the origin, as it will go out.
  dispatch::Round round;
  // Where it came from; nothing at the origin.
  std::optional<PeerId> from{};
  // The peer that it came from is a relay that the configuration names.
  bool by_relay = false;
  // The last stage that ended; 0 before the first.
  std::size_t stage = 0;
  // The judgement of that stage.
  Verdict verdict{};
  // When the computation in progress began; until begin_computation() tells, when the message was
  // handed over.
  TimePoint began{};
  // How the next transmission is sent, where the guard has weighed that; it stays.
  struct Mode {
    // The best variant that is sent.
    std::uint8_t variant = 0;
    bool degraded = false;
  };
  std::optional<Mode> mode{};
  std::optional<Previewed> previewed{};
};

// Whose a context is: the peer that the round came from, or kOurselves for a round that began here.
inline constexpr PeerId kOurselves{0};

// Keeps the contexts of each owner apart: an owner that has as many as it may have loses its own
// oldest one for the next, and nobody else's. Stages owns one. Peers name rounds as they like; one
// that names a round that another peer has open is dropped by Rounds before it gets here, or takes
// its place where it began the round itself. Memory: about 900 bytes for each context. Pure;
// thread-compatible.
class Contexts {
 public:
  // The context of a round; nullptr where there is none (any more).
  RoundContext* find(const RoundRef& round);
  // Whose the context of this round is.
  std::optional<PeerId> owner(const RoundRef& round) const;
  // Adds a context that is kept until `expires`. False: the owner had `most` already, and its
  // oldest one has gone for this.
  bool open(TimePoint now, PeerId owner, const RoundRef& round, RoundContext context,
            TimePoint expires, std::size_t most);
  void close(RoundRef round);
  // The owner is gone, or has begun a new session.
  void forget(PeerId owner);
  std::size_t count(PeerId owner) const;

 private:
  struct Opened {
    RoundContext context;
    PeerId owner{};
    // Counts the contexts that were opened.
    std::uint64_t number = 0;
    TimePoint expires{};
  };
  std::map<RoundRef, Opened> contexts_;
  // When the time of each context is over.
  std::set<std::pair<TimePoint, RoundRef>> expiries_;
  // The contexts of each owner that has any, by their numbers: the first is the oldest.
  std::map<PeerId, std::map<std::uint64_t, RoundRef>> owned_;
  std::uint64_t opened_ = 0;
};

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

// Keeps the messages of each peer apart, in memory that is shared with plain messages (HeldMemory).
// Stages owns one, and serves at once what finds no room. A peer that fills its part makes only its
// own messages be served in the variant that comes first. Pure; thread-compatible.
class HeldVariants {
 public:
  // `memory` must outlive this.
  explicit HeldVariants(HeldMemory& memory) : memory_(memory) {}

  // The message of this peer that waits for the end of the same stage of the same round; else
  // nullptr.
  const Held* find(PeerId peer, const dispatch::Round& round) const;
  // Whether one more message of `bytes` bytes may wait where the peer may have `most` messages.
  bool has_room(PeerId peer, std::size_t bytes, std::size_t most) const {
    return memory_.has_room(peer, bytes, most);
  }
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

 private:
  // By their time and, of equal ones, in the order in which they came.
  using Key = std::pair<TimePoint, std::uint64_t>;
  using Waiting = std::map<Key, Held>;
  Held take(Waiting::iterator it);
  template <class Which>
  void drop_of(PeerId peer, const Which& which);

  Waiting waiting_;
  // The peers of which something waits.
  std::map<PeerId, std::vector<Key>> peers_;
  HeldMemory& memory_;
  std::uint64_t added_ = 0;
};

}  // namespace interneuron::rounds
