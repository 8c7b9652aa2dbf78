// The header of a plain message <-> bytes; docs/wire_format.md ("Plain header") is the authority.
// Never throws, never allocates. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "interneuron/units.h"

namespace interneuron::wire {

// The least size; that of a header that holds all that it may is kMostPlainHeaderBytes.
inline constexpr std::size_t kPlainHeaderBytes = 20;
inline constexpr std::size_t kNeedsBytes = 5;
inline constexpr std::size_t kOrderBytes = 6;
inline constexpr std::size_t kMostPlainHeaderBytes = kPlainHeaderBytes + kNeedsBytes + kOrderBytes;

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
  // The weights of delay, bandwidth, reliability and security and the least security score of a
  // link, 1/255 each; nothing: delay alone counts (interneuron::Needs).
  struct Needs {
    std::array<std::uint8_t, 4> weights{};
    std::uint8_t min_security = 0;
    friend bool operator==(const Needs&, const Needs&) = default;
  };
  std::optional<Needs> needs{};
  // It is to be handed over after those of its channel before it: how far back the identifier of
  // the last one lies, 0 where there is none; and how long it waits for it, in microseconds.
  struct Order {
    std::uint16_t back = 0;
    std::uint32_t wait_us = 0;
    friend bool operator==(const Order&, const Order&) = default;
    Duration wait() const { return std::chrono::microseconds(wait_us); }
  };
  std::optional<Order> order{};
  friend bool operator==(const PlainHeader&, const PlainHeader&) = default;

  std::size_t bytes() const {
    return kPlainHeaderBytes + (needs ? kNeedsBytes : 0) + (order ? kOrderBytes : 0);
  }
  // Whether of its channel none is wanted that is older than one that was delivered.
  bool only_after() const { return newest_only || order; }
  Duration deadline() const { return std::chrono::microseconds(deadline_us); }
};

// How many bytes of a message are its header, by its first kPlainHeaderBytes.
std::size_t plain_header_bytes(std::span<const std::byte, kPlainHeaderBytes> begin);
// The header that a message begins with; nothing when it is too short or malformed.
std::optional<PlainHeader> parse_plain_header(ByteView message);
// Writes the first header.bytes() of `out`. `header` must be valid, which is asserted.
void write_plain_header(std::span<std::byte> out, const PlainHeader& header);

}  // namespace interneuron::wire
