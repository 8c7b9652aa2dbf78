// complete_checksum(), ecn_of() and mark_congestion(): what the emulator reads and changes in the
// bytes of packets.
#include "netns/emulator/frames.h"

#include <bit>
#include <cstdint>
#include <cstring>
#include <optional>

namespace interneuron::netns {

namespace {

constexpr std::size_t kEthernetBytes = 14;
constexpr unsigned kTypeIpv4 = 0x0800;
constexpr unsigned kTypeIpv6 = 0x86dd;
constexpr std::size_t kMinIpv4Header = 20;
constexpr std::size_t kIpv6Bytes = 40;
constexpr unsigned kProtocolTcp = 6;
constexpr unsigned kProtocolUdp = 17;
// Offsets of the checksums in their headers.
constexpr std::size_t kUdpChecksum = 6;
constexpr std::size_t kTcpChecksum = 16;
constexpr std::size_t kIpv4Checksum = 10;

unsigned byte_at(std::span<const std::byte> data, std::size_t i) {
  return std::to_integer<unsigned>(data[i]);
}

unsigned word_at(std::span<const std::byte> data, std::size_t i) {
  return byte_at(data, i) << 8U | byte_at(data, i + 1);
}

void put_word(std::span<std::byte> data, std::size_t i, unsigned word) {
  data[i] = static_cast<std::byte>(word >> 8U);
  data[i + 1] = static_cast<std::byte>(word);
}

bool is_ipv6(std::span<const std::byte> packet) { return byte_at(packet, 0) >> 4U == 6; }

std::uint16_t fold(std::uint64_t sum) {
  while (sum >> 16U != 0) sum = (sum & 0xffffU) + (sum >> 16U);
  return static_cast<std::uint16_t>(sum);
}

// One's complement sum of big-endian 16-bit words. The sum does not depend on the order of bytes
// (RFC 1071 section 2 (B)), so words in the machine's own order are added, four bytes at a time,
// and the bytes of the result are swapped.
std::uint16_t sum_words(std::span<const std::byte> data) {
  std::uint64_t sum = 0;
  std::size_t i = 0;
  for (; i + 4 <= data.size(); i += 4) {
    std::uint32_t word = 0;
    std::memcpy(&word, data.data() + i, sizeof word);
    sum += word;
  }
  std::uint32_t rest = 0;
  std::memcpy(&rest, data.data() + i, data.size() - i);
  const std::uint16_t folded = fold(sum + rest);
  if constexpr (std::endian::native == std::endian::big) return folded;
  return static_cast<std::uint16_t>(folded << 8U | folded >> 8U);
}

// The parts of a packet that the checksum covers; views into the frame.
struct Packet {
  // Source and destination.
  std::span<std::byte> addresses;
  unsigned protocol = 0;
  // Transport header and payload.
  std::span<std::byte> segment;
};

std::optional<Packet> parse_ipv4(std::span<std::byte> ip) {
  if (ip.size() < kMinIpv4Header) return std::nullopt;
  const std::size_t header = (byte_at(ip, 0) & 0xfU) * 4;
  const std::size_t total = word_at(ip, 2);
  // The flag "more fragments" or an offset.
  const bool fragment = (word_at(ip, 6) & 0x3fffU) != 0;
  if (fragment || header < kMinIpv4Header || total < header || total > ip.size()) {
    return std::nullopt;
  }
  return Packet{ip.subspan(12, 8), byte_at(ip, 9), ip.subspan(header, total - header)};
}

std::optional<Packet> parse_ipv6(std::span<std::byte> ip) {
  if (ip.size() < kIpv6Bytes) return std::nullopt;
  const std::size_t payload = word_at(ip, 4);
  if (payload > ip.size() - kIpv6Bytes) return std::nullopt;
  return Packet{ip.subspan(8, 32), byte_at(ip, 6), ip.subspan(kIpv6Bytes, payload)};
}

std::optional<Packet> parse(std::span<std::byte> frame) {
  if (frame.size() < kEthernetBytes) return std::nullopt;
  const unsigned type = word_at(frame, 12);
  if (type == kTypeIpv4) return parse_ipv4(frame.subspan(kEthernetBytes));
  if (type == kTypeIpv6) return parse_ipv6(frame.subspan(kEthernetBytes));
  return std::nullopt;
}

}  // namespace

bool complete_checksum(std::span<std::byte> frame) {
  const std::optional<Packet> packet = parse(frame);
  if (!packet) return false;
  const auto& [addresses, protocol, segment] = *packet;
  if (protocol != kProtocolUdp && protocol != kProtocolTcp) return false;
  const std::size_t field = protocol == kProtocolUdp ? kUdpChecksum : kTcpChecksum;
  if (segment.size() < field + 2) return false;
  segment[field] = segment[field + 1] = std::byte{0};
  const std::uint64_t pseudo_header =
      std::uint64_t{sum_words(addresses)} + protocol + segment.size();
  auto value = static_cast<std::uint16_t>(~fold(pseudo_header + sum_words(segment)));
  // In UDP 0 would mean that there is no checksum (RFC 768).
  if (value == 0 && protocol == kProtocolUdp) value = 0xffff;
  put_word(segment, field, value);
  return true;
}

emu::Ecn ecn_of(std::span<const std::byte> packet) {
  const auto second = std::to_integer<unsigned>(packet[1]);
  return static_cast<emu::Ecn>((is_ipv6(packet) ? second >> 4U : second) & 3U);
}

void mark_congestion(std::span<std::byte> packet) {
  if (is_ipv6(packet)) {
    packet[1] |= std::byte{0x30};
    return;
  }
  // The incremental update of RFC 1624: HC' = ~(~HC + ~m + m').
  const unsigned before = word_at(packet, 0);
  packet[1] |= std::byte{0x03};
  const unsigned sum = fold(std::uint64_t{~word_at(packet, kIpv4Checksum) & 0xffffU} +
                            (~before & 0xffffU) + word_at(packet, 0));
  put_word(packet, kIpv4Checksum, ~sum);
}

}  // namespace interneuron::netns
