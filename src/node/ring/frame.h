// Frames with a UDP datagram in them, as bytes: builds their headers (Ethernet with or without a
// VLAN tag of IEEE 802.1Q, or none on devices of the IP layer; IPv4, RFC 791, or IPv6, RFC 8200;
// UDP, RFC 768) and takes received ones apart. For a transport that goes around the kernel's IP
// layer and so has to refuse itself what that would have refused.
//
// Pure values, no system calls, no memory beyond the arguments. Every length in a frame is a
// stranger's claim and is held against the bytes that are there; what is refused has a named
// reason. Errors: never throws. Thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <variant>

#include "interneuron/address.h"
#include "interneuron/units.h"
#include "node/io/nic.h"

namespace interneuron::io {

// Ethernet types (IEEE 802; RFC 894, RFC 2464) and those of VLAN tags (IEEE 802.1Q and its service
// tag).
inline constexpr std::uint16_t kTypeIpv4 = 0x0800;
inline constexpr std::uint16_t kTypeIpv6 = 0x86dd;
inline constexpr std::uint16_t kTypeTag = 0x8100;
inline constexpr std::uint16_t kTypeServiceTag = 0x88a8;
// Protocol numbers: UDP, and the fragment header of IPv6.
inline constexpr std::uint8_t kUdp = 17;
inline constexpr std::uint8_t kFragmentHeader = 44;

// The headers of the largest frame: Ethernet 14, VLAN tag 4, IPv6 40, UDP 8.
inline constexpr std::size_t kMostHeaderBytes = 14 + 4 + 40 + 8;
// The largest payload of a datagram over IPv4: 65535 - 20 - 8; IPv6 is held to the same.
inline constexpr std::size_t kMostPayloadBytes = 65507;

// The header of Ethernet.
struct EthernetHeader {
  Mac to{};
  Mac from{};
  // The priority and the number of a VLAN tag, as in its TCI; without: no tag.
  std::optional<std::uint16_t> tag{};
};

// Who sends to whom. Both addresses are of one family.
struct FrameAddresses {
  // Nothing on a device whose frames begin with the IP header.
  std::optional<EthernetHeader> ethernet{};
  Address from{};
  Address to{};
  // The ECN bits of the IP header (RFC 3168 §5), 0 … 3.
  std::uint8_t ecn = 0;
};

// Headers ready to stand before a payload.
struct FrameHeader {
  std::array<std::byte, kMostHeaderBytes> bytes{};
  std::size_t size = 0;
  // Where the UDP header begins. Its checksum field, 6 bytes behind, holds the sum over the pseudo
  // header, as whoever completes the checksum (the NIC, the kernel or complete_checksum()) wants
  // it.
  std::size_t udp_at = 0;

  ByteView view() const { return ByteView(bytes).first(size); }
};

// Headers for `payload_bytes` bytes: never to be fragmented, with the hop limit of RFC 1700, 64.
// Nothing when the families differ or are none, or when the payload is larger than
// kMostPayloadBytes.
std::optional<FrameHeader> build_header(const FrameAddresses& addresses, std::size_t payload_bytes);

// Completes the UDP checksum over the payload, which may come in parts.
void complete_checksum(FrameHeader& header, std::span<const ByteView> payload);

// Why a frame is refused.
enum class FrameProblem : std::uint8_t {
  // It ends within a header, or before the length that its IP header claims.
  kTruncated,
  // Not IP, or of another version than its frame says.
  kNotIp,
  // A header length of IPv4 below its least, a total length that does not hold the headers.
  kLength,
  kIpChecksum,
  // A part of a larger packet. Nobody here puts parts together.
  kFragment,
  // Not UDP, or behind extension headers of IPv6.
  kNotUdp,
  // Its UDP length is less than a UDP header or more than the IP packet holds.
  kUdpLength,
  // Wrong, or absent over IPv6, which forbids that (RFC 8200 §8.1).
  kUdpChecksum,
  // From an address that no packet may come from: unspecified, multicast, broadcast, or this host's
  // loopback (RFC 1122 §3.2.1.3).
  kSource,
  // It is of a VLAN, which is another network than the untagged one. Tags with number 0 bear a
  // priority only and are no VLAN.
  kVlan,
};
inline constexpr std::size_t kFrameProblems = static_cast<std::size_t>(FrameProblem::kVlan) + 1;
// "truncated", "UDP checksum", …
std::string_view name_of(FrameProblem problem);

// What is known of a frame beside its bytes.
struct FrameContext {
  // Whether it begins with an Ethernet header; else with the IP header.
  bool ethernet = true;
  // The kernel or the NIC has verified the UDP checksum, or the frame has not left this host and
  // nobody has computed it yet; then it is not looked at.
  bool checksum_known = false;
  // Nobody says whether the UDP checksum has been computed: one that is the sum over the pseudo
  // header alone, as a sender on this host leaves it to its NIC, is as good as a right one.
  bool may_be_partial = false;
  // Whether addresses of the loopback card may come from this device.
  bool loopback = false;
  // The index of the device: the scope of link-local addresses of IPv6.
  std::uint32_t device = 0;
};

// A datagram in a frame.
struct ParsedFrame {
  Address from{};
  Address to{};
  std::uint8_t ecn = 0;
  // Within the frame.
  ByteView payload;
};

std::variant<ParsedFrame, FrameProblem> parse_frame(ByteView frame, const FrameContext& context);

}  // namespace interneuron::io
