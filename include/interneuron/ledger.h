// What one peer may take of an endpoint, what it holds of it now, and how often it was held back.
// docs/limits.md has the table of all limits. Plain values.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "interneuron/message.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron {

// What each peer may take. At a limit only what this peer itself holds or sends makes room: its
// oldest goes, or what it has just sent is dropped, and nobody else notices. A relay that the
// configuration names (EndpointOptions::relays) speaks for several vehicles and may have
// kRelayedPeers times as many contexts, pipelines and held messages.
struct PeerLimits {
  // Rounds of the peer that the application works on here. Pipelined rounds of 100 ms that are
  // worked on for a second come to 10 for each pipeline. The oldest goes.
  std::size_t contexts = 64;
  // Pipelines of the peer of which the endpoint learns how long stages take. A vehicle has one for
  // each kind of sensor. The one that was least recently used goes.
  std::size_t pipelines = 8;
  // Messages of the peer that wait for a better variant. One more is served at once.
  std::size_t held_messages = 16;
  // No deadline that a peer states counts for more than this: contexts, messages that wait and
  // incomplete messages do not live longer, and the application is told no longer one. Rounds are
  // for what is over in a second; no measurement behind this value.
  Duration longest_deadline = std::chrono::seconds(10);
};

// How many vehicles a relay is taken to speak for. No measurement behind this value: 64 pipelines
// are what an endpoint kept for all of its peers together before each had limits of its own.
inline constexpr std::size_t kRelayedPeers = 8;

// The limits that may strike; [i] of PeerLedger::strikes is about the one of this value.
enum class PeerLimit : std::uint8_t {
  kContexts,
  kPipelines,
  kHeldMessages,
  kDeadline,
  // Not a number: the peer has sent a round of another origin than itself.
  kOrigin,
};
inline constexpr std::size_t kPeerLimitCount = 5;
// "contexts", "pipelines", "held", "deadline", "origin".
std::string_view to_string(PeerLimit limit);

// What a peer holds at one instant, and what has struck it since it came.
struct PeerLedger {
  std::size_t contexts = 0;
  std::size_t pipelines = 0;
  std::size_t held_messages = 0;
  std::size_t held_bytes = 0;
  std::array<std::uint64_t, kPeerLimitCount> strikes{};

  std::uint64_t struck(PeerLimit limit) const { return strikes[static_cast<std::size_t>(limit)]; }
};

}  // namespace interneuron
