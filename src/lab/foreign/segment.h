// What the two ends of a TCP-like connection tell each other. A segment carries a piece of the
// connection's stream over one subflow: TCP has one subflow, MPTCP (RFC 8684) several, and then a
// piece has a place in the subflow and another one in the stream. Sequence numbers count bytes from
// 0 in 64 bits, so that they never wrap. Plain values, copied as they are into a ForeignPacket.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "interneuron/units.h"

namespace interneuron::foreign {

// IPv4 and TCP without options take 40 bytes, timestamps (RFC 7323) 12 more.
inline constexpr std::size_t kTcpIpBytes = 52;
// The payload of a full segment in an IP packet of 1500 bytes.
inline constexpr std::uint32_t kMss = 1500 - kTcpIpBytes;
// The SACK blocks that fit beside timestamps (RFC 2018, section 3).
inline constexpr std::size_t kMostSackBlocks = 3;

// A part of the stream. None reaches over the end of a message, as with MSG_EOR of Linux.
struct Piece {
  std::uint64_t offset = 0;
  std::uint32_t bytes = 0;
  std::uint32_t message = 0;
  // It is the last one of its message.
  bool ends_message = false;
};

struct DataSegment {
  std::uint32_t connection = 0;
  std::uint64_t sequence = 0;
  Piece piece;
  // When it was sent, for the receiver to echo.
  Duration sent{};
  // The sender has answered a mark (RFC 3168, section 6.1.2).
  bool window_reduced = false;
};

// [from, to).
struct Range {
  std::uint64_t from = 0;
  std::uint64_t to = 0;
};

struct AckSegment {
  // Everything before it has arrived.
  std::uint64_t acknowledged = 0;
  std::array<Range, kMostSackBlocks> sacks{};
  std::size_t sack_count = 0;
  // The stamp of the earliest segment that this acknowledges (RFC 7323, section 4.3).
  Duration echo{};
  // A mark has come and the sender has not answered it yet.
  bool congestion_seen = false;
};

template <class Segment>
Bytes packed(const Segment& segment) {
  static_assert(std::is_trivially_copyable_v<Segment>);
  Bytes out(sizeof segment);
  std::memcpy(out.data(), &segment, sizeof segment);
  return out;
}

template <class Segment>
Segment unpacked(const Bytes& bytes) {
  static_assert(std::is_trivially_copyable_v<Segment>);
  Segment out;
  std::memcpy(&out, bytes.data(), sizeof out);
  return out;
}

}  // namespace interneuron::foreign
