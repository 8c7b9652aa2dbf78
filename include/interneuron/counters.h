// What an endpoint counts since it exists. Everything that a peer sends and that is not used is
// counted in one of these, never thrown.
#pragma once

#include <cstdint>

namespace interneuron {

// What was counted on one link, over all peers. Every received datagram is in exactly one of
// received, duplicate, malformed, other_version, other, unauthentic, handshake and refused.
struct LinkCounters {
  std::uint64_t sent_packets = 0;
  // Bytes of UDP payload.
  std::uint64_t sent_bytes = 0;
  std::uint64_t received_packets = 0;
  std::uint64_t received_bytes = 0;
  // The packet's number was seen before, or is too old to tell.
  std::uint64_t duplicate_packets = 0;
  // The bytes are no packet of ours.
  std::uint64_t malformed_packets = 0;
  // The bytes look like a packet of another version of the protocol.
  std::uint64_t other_version_packets = 0;
  // A packet of a peer whose type this version does not use; it is acknowledged and not read.
  std::uint64_t other_packets = 0;
  // A packet from somebody whom this endpoint does not serve, or not before he has proved his
  // address: the first one of every peer is among them. Or a packet of a peer that sends more than
  // it may (PeerLimits::packets_per_second).
  std::uint64_t refused_packets = 0;
  // Where packets are encrypted: packets that no key of ours opens, whoever changed or made them,
  // and packets in the clear, but for those of handshakes that this endpoint takes part in.
  std::uint64_t unauthentic_packets = 0;
  std::uint64_t handshake_packets = 0;
  // Fragments of messages that were sent again.
  std::uint64_t fragments_resent = 0;
  // Repair symbols that were sent beside the fragments of messages.
  std::uint64_t symbols_sent = 0;
  // Packets that were found lost, by the peer's feedback or its silence.
  std::uint64_t fragments_lost = 0;
};

// What an endpoint has counted since it was made, over all of its peers.
struct EndpointCounters {
  // Complete messages with a valid header, whatever became of them.
  std::uint64_t messages_completed = 0;
  // Messages that were incomplete at their deadline.
  std::uint64_t messages_expired = 0;
  // Complete messages whose stage had been served already, by another variant or copy, and plain
  // ones of which another variant, or a newer one of the channel, was delivered.
  std::uint64_t messages_superseded = 0;
  // Remote results after the end-to-end deadline, and plain messages after theirs.
  std::uint64_t messages_late = 0;
  // Fragments that were not sent, or not sent again, because they could not arrive in time.
  std::uint64_t fragments_cancelled = 0;
  // Complete messages whose round header or plain header is malformed or inconsistent.
  std::uint64_t bad_messages = 0;
  // Complete messages of rounds that their peer has no part in: it is neither their origin nor, of
  // rounds that began here, one that they were sent to, nor a relay (EndpointOptions::relays).
  std::uint64_t foreign_rounds = 0;
  // Fragments refused because the incomplete messages of the peer, or of all peers, hold as much
  // memory as they may.
  std::uint64_t reassembly_refused = 0;
  // Fragments that contradict those of their message that came before: they are dropped, and the
  // message goes on.
  std::uint64_t bad_fragments = 0;
};

}  // namespace interneuron
