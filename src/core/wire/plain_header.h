// The header of a plain message <-> bytes; docs/wire_format.md ("Plain header") is the authority.
// Never throws, never allocates. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "interneuron/units.h"

namespace interneuron::wire {

inline constexpr std::size_t kPlainHeaderBytes = 20;

// What a message that belongs to no round begins with. Each variant of the message is a message of
// its own to flow, with a header that differs in `variant` alone.
struct PlainHeader {
  // Counts the sender's plain messages to this peer, from anywhere; all variants of a message have
  // the same.
  std::uint32_t id = 0;
  // From t0, in microseconds; not 0. After that nobody wants the message any more.
  std::uint32_t deadline_us = 0;
  // When the application handed the message over, by the sender's clock.
  PeerTime t0{};
  std::uint16_t channel = 0;
  // How much the message matters, 0 … 255, against others that want the same link.
  std::uint8_t importance = 0;
  // 0 is the best; less than kMaxVariants.
  std::uint8_t variant = 0;
  // A message of the channel that was handed over before another one that was delivered is not
  // wanted any more.
  bool newest_only = false;
  // A better variant is on its way, and the sender's policy would have this one kept for it as long
  // as the deadline allows.
  bool awaits_better = false;
  friend bool operator==(const PlainHeader&, const PlainHeader&) = default;

  Duration deadline() const { return std::chrono::microseconds(deadline_us); }
};

// The header that a message begins with; nothing when it is too short or malformed.
std::optional<PlainHeader> parse_plain_header(ByteView message);
// `header` must be valid, which is asserted.
void write_plain_header(std::span<std::byte, kPlainHeaderBytes> out, const PlainHeader& header);

}  // namespace interneuron::wire
