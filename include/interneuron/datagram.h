// What an Endpoint takes in and gives out: UDP payloads with what has to be said of them. Plain
// values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "interneuron/address.h"
#include "interneuron/round.h"
#include "interneuron/units.h"

namespace interneuron {

// A UDP payload that came in on a link.
struct Datagram {
  LinkId link{};
  Address from{};
  ByteView bytes;
  // The ECN bits of its IP header (RFC 3168 §5), 0 … 3; 0 where nobody knows.
  std::uint8_t ecn = 0;
};

// A datagram that came to the door and that another endpoint is for (shard.h).
struct HandedOn {
  // Which: 1 … Shard::count.
  std::uint8_t shard = 0;
  LinkId link{};
  Address from{};
  std::uint8_t ecn = 0;
  Bytes bytes;
};

// A UDP payload to send: the first `size` bytes of the buffer given to poll_transmit().
struct Transmit {
  LinkId link{};
  Address to{};
  std::size_t size = 0;
  // The ECN bits for its IP header.
  std::uint8_t ecn = 0;
  // The round whose message it carries bytes of: for those who treat packets by their round, since
  // one that is encrypted does not tell. Nothing in all other packets.
  std::optional<RoundRef> round{};
};

// The same in parts that nobody has joined: the first `head` bytes of the buffer given to
// poll_transmit_parts(), then `payload`, then the `tail` bytes of the buffer that follow the first.
struct TransmitParts {
  LinkId link{};
  Address to{};
  std::size_t head = 0;
  // Bytes of a message; empty in packets that carry none or are encrypted. Valid until the next
  // call of the endpoint that is no output (see Endpoint).
  ByteView payload{};
  std::size_t tail = 0;
  // The ECN bits for its IP header.
  std::uint8_t ecn = 0;
  // As in Transmit.
  std::optional<RoundRef> round{};

  std::size_t size() const { return head + payload.size() + tail; }
  // Puts the payload where it belongs in that buffer.
  Transmit join(std::span<std::byte> buffer) const;
};

}  // namespace interneuron
