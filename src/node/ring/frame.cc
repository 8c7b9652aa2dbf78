#include "node/ring/frame.h"

#include <netinet/in.h>

#include <algorithm>
#include <cstring>

#include "node/io/address.h"

namespace interneuron::io {

namespace {

// The number of the VLAN within a tag; 0 stands for none.
constexpr std::uint16_t kVlanMask = 0x0fff;
// Tags that a frame may bear: a service tag and one within, with one to spare.
constexpr int kMostTags = 3;

// Sizes of headers, bytes.
constexpr std::size_t kEthernetBytes = 14;
constexpr std::size_t kTagBytes = 4;
constexpr std::size_t kIpv4Bytes = 20;
constexpr std::size_t kIpv6Bytes = 40;
constexpr std::size_t kUdpBytes = 8;
// Where the checksum stands in the header of UDP and of IPv4.
constexpr std::size_t kUdpCheck = 6;
constexpr std::size_t kIpv4Check = 10;

// Bits of the word of IPv4 that holds the fragment offset: more fragments, the offset, don't
// fragment.
constexpr std::uint16_t kMoreOrOffset = 0x3fff;
constexpr std::uint16_t kDontFragment = 0x4000;
// The hop limit of what we send: RFC 1700, "IP TIME TO LIVE PARAMETER".
constexpr std::uint8_t kHopLimit = 64;
constexpr std::uint8_t kEcnMask = 3;

std::uint8_t get8(ByteView bytes, std::size_t at) {
  return std::to_integer<std::uint8_t>(bytes[at]);
}

std::uint16_t get16(ByteView bytes, std::size_t at) {
  return static_cast<std::uint16_t>(get8(bytes, at) << 8 | get8(bytes, at + 1));
}

void put16(std::byte* to, std::size_t value) {
  to[0] = static_cast<std::byte>(value >> 8 & 0xff);
  to[1] = static_cast<std::byte>(value & 0xff);
}

// The ones' complement sum of RFC 1071, of bytes that may come in parts. Words are added in the
// order of this host, which gives the same sum in that order.
class Sum {
 public:
  void add(ByteView bytes) {
    std::uint64_t part = 0;
    const std::byte* at = bytes.data();
    std::size_t left = bytes.size();
    for (; left >= sizeof(std::uint32_t); left -= sizeof(std::uint32_t)) {
      std::uint32_t word = 0;
      std::memcpy(&word, at, sizeof word);
      part += word;
      at += sizeof word;
    }
    std::array<std::byte, sizeof(std::uint32_t)> rest{};
    std::copy_n(at, left, rest.begin());
    std::uint32_t word = 0;
    std::memcpy(&word, rest.data(), sizeof word);
    std::uint32_t folded = fold(part + word);
    // Behind an odd number of bytes every byte stands in the other half of its word.
    if (odd_) folded = (folded << 8 | folded >> 8) & 0xffff;
    total_ += folded;
    odd_ = odd_ != (bytes.size() % 2 != 0);
  }
  void add16(std::size_t value) {
    std::array<std::byte, 2> bytes{};
    put16(bytes.data(), value);
    add(bytes);
  }
  std::uint16_t value() const { return static_cast<std::uint16_t>(fold(total_)); }

 private:
  static std::uint32_t fold(std::uint64_t sum) {
    while (sum >> 16 != 0) sum = (sum & 0xffff) + (sum >> 16);
    return static_cast<std::uint32_t>(sum);
  }

  std::uint64_t total_ = 0;
  bool odd_ = false;
};

void store(std::byte* to, std::uint16_t sum) { std::memcpy(to, &sum, sizeof sum); }
std::uint16_t load(const std::byte* from) {
  std::uint16_t sum = 0;
  std::memcpy(&sum, from, sizeof sum);
  return sum;
}

// The bytes of the bare address.
ByteView host_of(const Address& address) {
  const ByteView raw(address.raw);
  if (family_of(address) == AF_INET) {
    return raw.subspan(offsetof(sockaddr_in, sin_addr), sizeof(in_addr));
  }
  return raw.subspan(offsetof(sockaddr_in6, sin6_addr), sizeof(in6_addr));
}

// The sum over the pseudo header (RFC 768; RFC 8200 §8.1).
Sum pseudo_sum(ByteView from, ByteView to, std::size_t udp_bytes) {
  Sum sum;
  sum.add(from);
  sum.add(to);
  sum.add16(kUdp);
  sum.add16(udp_bytes);
  return sum;
}

std::byte* put_ethernet(std::byte* at, const EthernetHeader& header, std::uint16_t type) {
  at = std::ranges::copy(header.to, at).out;
  at = std::ranges::copy(header.from, at).out;
  if (header.tag) {
    put16(at, kTypeTag);
    put16(at + 2, *header.tag);
    at += kTagBytes;
  }
  put16(at, type);
  return at + 2;
}

// The identification stays 0: what is never fragmented needs none (RFC 6864 §4.1).
std::byte* put_ipv4(std::byte* at, const FrameAddresses& addresses, std::size_t udp_bytes) {
  at[0] = std::byte{0x45};
  at[1] = static_cast<std::byte>(addresses.ecn & kEcnMask);
  put16(at + 2, kIpv4Bytes + udp_bytes);
  put16(at + 6, kDontFragment);
  at[8] = std::byte{kHopLimit};
  at[9] = std::byte{kUdp};
  std::ranges::copy(host_of(addresses.from), at + 12);
  std::ranges::copy(host_of(addresses.to), at + 16);
  Sum sum;
  sum.add({at, kIpv4Bytes});
  store(at + kIpv4Check, static_cast<std::uint16_t>(~sum.value()));
  return at + kIpv4Bytes;
}

std::byte* put_ipv6(std::byte* at, const FrameAddresses& addresses, std::size_t udp_bytes) {
  at[0] = std::byte{0x60};
  at[1] = static_cast<std::byte>((addresses.ecn & kEcnMask) << 4);
  put16(at + 4, udp_bytes);
  at[6] = std::byte{kUdp};
  at[7] = std::byte{kHopLimit};
  std::ranges::copy(host_of(addresses.from), at + 8);
  std::ranges::copy(host_of(addresses.to), at + 24);
  return at + kIpv6Bytes;
}

}  // namespace

std::optional<FrameHeader> build_header(const FrameAddresses& addresses,
                                        std::size_t payload_bytes) {
  const int family = family_of(addresses.to);
  if (family == AF_UNSPEC || family != family_of(addresses.from) ||
      payload_bytes > kMostPayloadBytes) {
    return std::nullopt;
  }
  const std::size_t udp_bytes = kUdpBytes + payload_bytes;
  FrameHeader out;
  std::byte* at = out.bytes.data();
  if (addresses.ethernet) {
    at = put_ethernet(at, *addresses.ethernet, family == AF_INET ? kTypeIpv4 : kTypeIpv6);
  }
  at = family == AF_INET ? put_ipv4(at, addresses, udp_bytes) : put_ipv6(at, addresses, udp_bytes);
  out.udp_at = static_cast<std::size_t>(at - out.bytes.data());
  put16(at, port_of(addresses.from));
  put16(at + 2, port_of(addresses.to));
  put16(at + 4, udp_bytes);
  store(at + kUdpCheck,
        pseudo_sum(host_of(addresses.from), host_of(addresses.to), udp_bytes).value());
  out.size = out.udp_at + kUdpBytes;
  return out;
}

void complete_checksum(FrameHeader& header, std::span<const ByteView> payload) {
  Sum sum;
  // The field already holds the sum over the pseudo header.
  sum.add(ByteView(header.bytes).subspan(header.udp_at, kUdpBytes));
  for (const ByteView part : payload) sum.add(part);
  const auto check = static_cast<std::uint16_t>(~sum.value());
  // 0 would say that there is no checksum (RFC 768).
  store(&header.bytes[header.udp_at + kUdpCheck], check == 0 ? std::uint16_t{0xffff} : check);
}

std::string_view name_of(FrameProblem problem) {
  static constexpr std::array<std::string_view, kFrameProblems> kNames = {
      "truncated", "not IP",     "length",       "IP checksum", "fragment",
      "not UDP",   "UDP length", "UDP checksum", "source",      "VLAN"};
  const auto index = static_cast<std::size_t>(problem);
  return index < kNames.size() ? kNames[index] : "?";
}

namespace {

// What is left of a frame behind a header that was read, or why it is refused.
using Step = std::optional<FrameProblem>;

// Takes the header of Ethernet and its tags off; `version`: that of IP by the type.
Step take_ethernet(ByteView& frame, int& version) {
  if (frame.size() < kEthernetBytes) return FrameProblem::kTruncated;
  std::uint16_t type = get16(frame, kEthernetBytes - 2);
  frame = frame.subspan(kEthernetBytes);
  for (int tags = 0; type == kTypeTag || type == kTypeServiceTag; ++tags) {
    if (frame.size() < kTagBytes) return FrameProblem::kTruncated;
    if (tags >= kMostTags || (get16(frame, 0) & kVlanMask) != 0) return FrameProblem::kVlan;
    type = get16(frame, 2);
    frame = frame.subspan(kTagBytes);
  }
  version = type == kTypeIpv4 ? 4 : type == kTypeIpv6 ? 6 : 0;
  return {};
}

// An IP packet that holds UDP: its addresses, and behind `udp` nothing that the packet does not
// claim.
struct Packet {
  ByteView from;
  ByteView to;
  std::uint8_t ecn = 0;
  ByteView udp;
};

Step read_ipv4(ByteView bytes, Packet& out) {
  if (bytes.size() < kIpv4Bytes) return FrameProblem::kTruncated;
  const std::size_t header = std::size_t{4} * (get8(bytes, 0) & 0x0fU);
  const std::size_t total = get16(bytes, 2);
  if (header < kIpv4Bytes || total < header) return FrameProblem::kLength;
  if (bytes.size() < total) return FrameProblem::kTruncated;
  Sum sum;
  sum.add(bytes.first(header));
  if (sum.value() != 0xffff) return FrameProblem::kIpChecksum;
  if ((get16(bytes, 6) & kMoreOrOffset) != 0) return FrameProblem::kFragment;
  if (get8(bytes, 9) != kUdp) return FrameProblem::kNotUdp;
  out = {bytes.subspan(12, 4), bytes.subspan(16, 4),
         static_cast<std::uint8_t>(get8(bytes, 1) & kEcnMask),
         bytes.subspan(header, total - header)};
  return {};
}

Step read_ipv6(ByteView bytes, Packet& out) {
  if (bytes.size() < kIpv6Bytes) return FrameProblem::kTruncated;
  const std::size_t length = get16(bytes, 4);
  if (bytes.size() - kIpv6Bytes < length) return FrameProblem::kTruncated;
  const std::uint8_t next = get8(bytes, 6);
  if (next == kFragmentHeader) return FrameProblem::kFragment;
  if (next != kUdp) return FrameProblem::kNotUdp;
  out = {bytes.subspan(8, 16), bytes.subspan(24, 16),
         static_cast<std::uint8_t>(get8(bytes, 1) >> 4 & kEcnMask),
         bytes.subspan(kIpv6Bytes, length)};
  return {};
}

Address address_of(ByteView host, std::uint16_t port, std::uint32_t device) {
  if (host.size() == sizeof(in_addr)) {
    sockaddr_in name{};
    name.sin_family = AF_INET;
    name.sin_port = htons(port);
    std::memcpy(&name.sin_addr, host.data(), host.size());
    return from_sockaddr(reinterpret_cast<const sockaddr*>(&name), sizeof name);
  }
  sockaddr_in6 name{};
  name.sin6_family = AF_INET6;
  name.sin6_port = htons(port);
  std::memcpy(&name.sin6_addr, host.data(), host.size());
  if (IN6_IS_ADDR_LINKLOCAL(&name.sin6_addr)) name.sin6_scope_id = device;
  return from_sockaddr(reinterpret_cast<const sockaddr*>(&name), sizeof name);
}

bool may_send(const Address& from, ByteView host, bool loopback) {
  if (is_unspecified(from) || (is_loopback(from) && !loopback)) return false;
  const std::uint8_t first = get8(host, 0);
  // 0/8, and from 224 on multicast, reserved and broadcast (RFC 1122 §3.2.1.3, RFC 1112 §4).
  if (host.size() == sizeof(in_addr)) return first != 0 && first < 224;
  return first != 0xff;
}

}  // namespace

std::variant<ParsedFrame, FrameProblem> parse_frame(ByteView frame, const FrameContext& context) {
  int version = 0;
  if (context.ethernet) {
    if (const Step problem = take_ethernet(frame, version)) return *problem;
  }
  if (frame.empty()) return FrameProblem::kTruncated;
  const int said = get8(frame, 0) >> 4;
  if ((said != 4 && said != 6) || (context.ethernet && version != said)) {
    return FrameProblem::kNotIp;
  }
  Packet packet;
  if (const Step problem = said == 4 ? read_ipv4(frame, packet) : read_ipv6(frame, packet)) {
    return *problem;
  }
  if (packet.udp.size() < kUdpBytes) return FrameProblem::kUdpLength;
  const std::size_t length = get16(packet.udp, 4);
  if (length < kUdpBytes || length > packet.udp.size()) return FrameProblem::kUdpLength;
  const ByteView udp = packet.udp.first(length);
  const bool absent = get16(udp, kUdpCheck) == 0;
  if (!context.checksum_known && absent && said == 6) return FrameProblem::kUdpChecksum;
  if (!context.checksum_known && !absent) {
    Sum sum = pseudo_sum(packet.from, packet.to, length);
    const bool partial = context.may_be_partial && load(&udp[kUdpCheck]) == sum.value();
    sum.add(udp);
    if (!partial && sum.value() != 0xffff) return FrameProblem::kUdpChecksum;
  }
  ParsedFrame out{address_of(packet.from, get16(udp, 0), context.device),
                  address_of(packet.to, get16(udp, 2), context.device), packet.ecn,
                  udp.subspan(kUdpBytes)};
  if (!may_send(out.from, packet.from, context.loopback)) return FrameProblem::kSource;
  return out;
}

}  // namespace interneuron::io
