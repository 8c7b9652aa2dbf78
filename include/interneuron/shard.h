// Several endpoints that serve one address together, so that a roadside unit uses more than one
// processor (docs/load.md, "Several cores"). Each peer belongs to one of them, its shard. Node
// makes them and hands every packet to the one that it is for; who drives an Endpoint by itself
// needs none of this.
//
// What comes first of a peer, where packets are encrypted, comes to the door: an endpoint that has
// no peers and only judges who may have a session, so that what a stranger may ask for is counted
// in one place. It gives each key a shard, the same one for as long as the door is there, and hands
// what that key asks for on to it (Endpoint::poll_handed_on()). From then on the sessions that the
// shard has numbered tell in their last byte whose they are. In the clear the last byte of the
// peer's own session tells it, and there is nothing for a door to do.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "interneuron/units.h"

namespace interneuron {

// As many as processors of a large host; any number up to 255 would do.
inline constexpr std::uint8_t kMaxShards = 64;

// What the endpoints of one address hold together of that which EndpointOptions bounds. Each adds
// and takes away its own; thread-safe.
struct SharedHoldings {
  // Peers that came unannounced.
  std::atomic<std::size_t> peers{0};
  std::atomic<std::size_t> reassembly_bytes{0};
  std::atomic<std::size_t> sending_bytes{0};
  // Messages that are whole and wait.
  std::atomic<std::size_t> held_bytes{0};
};

// Which of several endpoints this one is.
struct Shard {
  // How many serve peers; 0: this endpoint is alone, and the rest means nothing.
  std::uint8_t count = 0;
  // 1 … count: one that serves peers; 0: the door.
  std::uint8_t index = 0;
  // The same for all of them. Nothing: each has the budgets for itself.
  std::shared_ptr<SharedHoldings> holdings = {};

  bool is_door() const { return count > 0 && index == 0; }
};

// Where the one byte of a session's number lies in a packet that tells its shard.
inline constexpr std::size_t kShardByteAt = 7;

// The shard, 1 … count, of what a peer's sessions, its identifier and those of messages to it
// begin with.
constexpr std::uint8_t shard_of_byte(std::uint8_t last_byte, std::uint8_t count) {
  return static_cast<std::uint8_t>(last_byte % count + 1);
}
constexpr std::uint8_t shard_of(PeerId peer, std::uint8_t count) {
  return static_cast<std::uint8_t>((peer.value - 1) % count + 1);
}

}  // namespace interneuron
