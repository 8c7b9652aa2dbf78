// How many bytes a packet has, and what a message of the application costs on its way. The one
// place of these figures; docs/wire_format.md has the layout behind them.
#pragma once

#include <cstddef>

namespace interneuron {

// The largest UDP payload that is ever sent, in bytes. A carrier is known to reorder IP packets
// above 1440 bytes (docs/constants.md, "Datagrams and sockets"), and 1400 leaves room for the
// headers of IPv6 and of a tunnel within the 1500 bytes of Ethernet.
inline constexpr std::size_t kMaxDatagramBytes = 1400;

// The smallest UDP payload that every path must carry, in bytes: as QUIC asks (RFC 9000, section
// 14).
inline constexpr std::size_t kLeastDatagramBytes = 1200;

// The headers of IPv4 (without options) and of UDP around a payload, in bytes.
inline constexpr std::size_t kIpv4UdpBytes = 28;
// The same for IPv6.
inline constexpr std::size_t kIpv6UdpBytes = 48;

// The headers that rates and counters of bytes "on the wire" include, whatever the path is. A path
// over IPv6 is therefore counted 20 bytes a packet too small, 1.4 % of a full one.
inline constexpr std::size_t kIpUdpBytes = kIpv4UdpBytes;

// The largest packet at IP level, by the same count.
inline constexpr std::size_t kMaxPacketBytes = kMaxDatagramBytes + kIpUdpBytes;

// Our own headers around each piece of a message: packet header, fragment header and tag.
inline constexpr std::size_t kPieceOverheadBytes = 53;
// What is left for the message in a full datagram.
inline constexpr std::size_t kMaxPieceBytes = kMaxDatagramBytes - kPieceOverheadBytes;

// What a message of so many bytes takes on the wire in full packets, without the rounding to whole
// packets.
constexpr std::size_t wire_size(std::size_t message_bytes) {
  constexpr double kOverhead =
      static_cast<double>(kMaxPacketBytes) / static_cast<double>(kMaxPieceBytes);
  return static_cast<std::size_t>(static_cast<double>(message_bytes) * kOverhead);
}

}  // namespace interneuron
