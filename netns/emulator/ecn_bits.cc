#include "netns/emulator/ecn_bits.h"

#include <cstdint>

namespace interneuron::netns {

namespace {

constexpr std::size_t kIpv4Checksum = 10;

bool is_ipv6(std::span<const std::byte> packet) {
  return std::to_integer<unsigned>(packet[0]) >> 4U == 6;
}

unsigned word(std::span<const std::byte> packet, std::size_t at) {
  return std::to_integer<unsigned>(packet[at]) << 8U | std::to_integer<unsigned>(packet[at + 1]);
}

}  // namespace

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
  const unsigned before = word(packet, 0);
  packet[1] |= std::byte{0x03};
  unsigned sum = (~word(packet, kIpv4Checksum) & 0xffffU) + (~before & 0xffffU) + word(packet, 0);
  sum = (sum & 0xffffU) + (sum >> 16U);
  sum = (sum & 0xffffU) + (sum >> 16U);
  packet[kIpv4Checksum] = static_cast<std::byte>(~sum >> 8U);
  packet[kIpv4Checksum + 1] = static_cast<std::byte>(~sum);
}

}  // namespace interneuron::netns
