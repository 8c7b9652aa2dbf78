// What one peer may take of an endpoint, what it holds of it now, and how often it was held back.
// docs/limits.md has the table of all limits. Plain values.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string_view>

#include "interneuron/message.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron {

// The defaults of three of PeerLimits, which other defaults rest on.
inline constexpr std::size_t kReassemblyBytes = kMaxMessageBytes + 64 * 1024;
inline constexpr std::size_t kReassemblyMessages = 256;
inline constexpr Duration kLongestBelieved = std::chrono::seconds(10);

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
  // Plain messages of the peer that wait for those before them in an ordered channel: 600 packets a
  // second and Mbit/s of a tunnel over two links that differ by 60 ms. Those that wait are then
  // handed over without the missing ones.
  std::size_t ordered_messages = 1024;
  // Bytes of the peer's incomplete messages that have arrived, with what is kept beside them. The
  // largest message fits once, and four raw frames (512 KB) of three pipelined rounds each fit with
  // room to spare. What the peer's other messages hold that expire sooner goes, else the new piece
  // is refused.
  std::size_t reassembly_bytes = kReassemblyBytes;
  // Incomplete messages of the peer, by the same rule. 16 rounds of 8 variants fit twice.
  std::size_t reassembly_messages = kReassemblyMessages;
  // The largest message of a round, and the largest plain message, in bytes without their headers.
  // A larger one is refused with its first piece.
  std::size_t round_bytes = kMaxMessageBytes;
  std::size_t plain_bytes = kMaxMessageBytes;
  // Channels of plain messages with a bound of their own instead of plain_bytes.
  std::map<std::uint16_t, std::size_t> channel_bytes = {};
  // Packets of the peer per second; a quarter of that may come at once. More than 1 Gbit/s of full
  // packets, which no modem of a vehicle brings. Those beyond are dropped unread, as if lost.
  std::uint32_t packets_per_second = 100'000;
  // Complete messages of the peer per second; a quarter of that may come at once. Twice the densest
  // traffic that tests and benches offer (5,000 small ones). Those beyond are dropped.
  std::uint32_t messages_per_second = 10'000;
  // No deadline that a peer states counts for more than this: contexts, messages that wait and
  // incomplete messages do not live longer, and the application is told no longer one. Rounds are
  // for what is over in a second; no measurement behind this value.
  Duration longest_deadline = kLongestBelieved;
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
  // Bytes or number of incomplete messages.
  kReassembly,
  kMessageSize,
  kPacketRate,
  kMessageRate,
  // Not a number: the peer has sent a round of another origin than itself.
  kOrigin,
};
inline constexpr std::size_t kPeerLimitCount = 9;
// "contexts", "pipelines", "held", "deadline", "reassembly", "message size", "packet rate",
// "message rate", "origin".
std::string_view to_string(PeerLimit limit);

// What a peer holds at one instant, and what has struck it since it came.
struct PeerLedger {
  std::size_t contexts = 0;
  std::size_t pipelines = 0;
  std::size_t held_messages = 0;
  std::size_t held_bytes = 0;
  // How many incomplete messages of the peer there are, and what they hold.
  std::size_t reassembly_messages = 0;
  std::size_t reassembly_bytes = 0;
  // The longest lifetime of a message that the peer has stated, as far as it was believed.
  Duration longest_lifetime{};
  std::array<std::uint64_t, kPeerLimitCount> strikes{};

  std::uint64_t struck(PeerLimit limit) const { return strikes[static_cast<std::size_t>(limit)]; }
};

}  // namespace interneuron
