#include "netns/emulator/frames.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

namespace interneuron::netns::ecn_bits_test {
namespace {

using Packet = std::vector<std::byte>;

// The sum of an IPv4 header's words, folded: 0xffff where the checksum is right (RFC 791).
unsigned folded_sum(const Packet& packet) {
  unsigned sum = 0;
  for (std::size_t i = 0; i < 20; i += 2) {
    sum += std::to_integer<unsigned>(packet[i]) << 8U | std::to_integer<unsigned>(packet[i + 1]);
  }
  while (sum > 0xffff) sum = (sum & 0xffffU) + (sum >> 16U);
  return sum;
}

RC_GTEST_PROP(EcnBits, AMarkedIpv4HeaderHasARightChecksum, ()) {
  Packet packet;
  for (int i = 0; i < 20; ++i) {
    packet.push_back(static_cast<std::byte>(*rc::gen::inRange(0, 256)));
  }
  packet[0] = std::byte{0x45};
  packet[10] = packet[11] = {};
  const unsigned checksum = ~folded_sum(packet) & 0xffffU;
  packet[10] = static_cast<std::byte>(checksum >> 8U);
  packet[11] = static_cast<std::byte>(checksum & 0xffU);
  const std::byte dscp = packet[1] & std::byte{0xfc};
  mark_congestion(packet);
  RC_ASSERT(ecn_of(packet) == emu::Ecn::kCe);
  RC_ASSERT((packet[1] & std::byte{0xfc}) == dscp);
  RC_ASSERT(folded_sum(packet) == 0xffffU);
}

TEST(EcnBits, LieInTheTrafficClassOfIpv6) {
  Packet packet(40);
  // Traffic class 0xb9: EF and ECT(1); flow label 0xfffff.
  packet[0] = std::byte{0x6b};
  packet[1] = std::byte{0x9f};
  packet[2] = packet[3] = std::byte{0xff};
  EXPECT_EQ(ecn_of(packet), emu::Ecn::kEct1);
  mark_congestion(packet);
  EXPECT_EQ(ecn_of(packet), emu::Ecn::kCe);
  EXPECT_EQ(packet[0], std::byte{0x6b});
  EXPECT_EQ(packet[1], std::byte{0xbf});
}

TEST(EcnBits, LieInTheTypeOfServiceOfIpv4) {
  Packet packet(20);
  packet[0] = std::byte{0x45};
  packet[1] = std::byte{0xba};
  EXPECT_EQ(ecn_of(packet), emu::Ecn::kEct0);
}

}  // namespace
}  // namespace interneuron::netns::ecn_bits_test
