#include "netns/emulator/frames.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace interneuron::netns::checksum_test {
namespace {

using Frame = std::vector<std::byte>;

void put16(Frame& frame, std::size_t at, std::size_t value) {
  frame[at] = static_cast<std::byte>(value >> 8U);
  frame[at + 1] = static_cast<std::byte>(value & 0xffU);
}

unsigned get16(const Frame& frame, std::size_t at) {
  return std::to_integer<unsigned>(frame[at]) << 8U | std::to_integer<unsigned>(frame[at + 1]);
}

// Ethernet, IPv4 10.77.1.1 -> 10.77.1.2, transport header and payload of `size` bytes 0, 1, 2 ...
Frame make_frame(unsigned protocol, std::size_t size) {
  Frame frame(34 + size);
  put16(frame, 12, 0x0800);
  frame[14] = std::byte{0x45};
  put16(frame, 16, 20 + size);
  put16(frame, 20, 0x4000);  // do not fragment
  frame[23] = static_cast<std::byte>(protocol);
  put16(frame, 26, 0x0a4d);
  put16(frame, 28, 0x0101);
  put16(frame, 30, 0x0a4d);
  put16(frame, 32, 0x0102);
  for (std::size_t i = 0; i < size; ++i) frame[34 + i] = static_cast<std::byte>(i & 0xffU);
  return frame;
}

// Ethernet, IPv6 fd77:0:1:1::2 -> fd77:0:1::1, the same behind it.
Frame make_frame6(unsigned protocol, std::size_t size) {
  Frame frame(54 + size);
  put16(frame, 12, 0x86dd);
  frame[14] = std::byte{0x60};
  put16(frame, 18, size);
  frame[20] = static_cast<std::byte>(protocol);
  const Frame four = make_frame(protocol, size);
  std::copy(four.begin() + 34, four.end(), frame.begin() + 54);
  for (const std::size_t address : {22U, 38U}) {
    put16(frame, address, 0xfd77);
    put16(frame, address + 4, 1);
    put16(frame, address + 14, address == 22 ? 2 : 1);
  }
  put16(frame, 28, 1);
  return frame;
}

// What a receiver does: the sum over pseudo header and segment, checksum included, is 0xffff. Byte
// by byte, unlike the code under test.
unsigned receiver_sum(const Frame& frame, unsigned protocol) {
  const bool six = get16(frame, 12) == 0x86dd;
  const std::size_t begin = six ? 54 : 34;
  const std::size_t size = six ? get16(frame, 18) : get16(frame, 16) - 20;
  std::uint64_t sum = protocol + size;
  for (std::size_t at = six ? 22 : 26; at < begin; at += 2) sum += get16(frame, at);
  for (std::size_t i = 0; i < size; ++i) {
    const auto byte = std::to_integer<std::uint64_t>(frame[begin + i]);
    sum += i % 2 == 0 ? byte << 8U : byte;
  }
  while (sum >> 16U != 0) sum = (sum & 0xffffU) + (sum >> 16U);
  return static_cast<unsigned>(sum);
}

TEST(Checksum, IsWhatAReceiverAccepts) {
  for (const unsigned protocol : {6U, 17U}) {
    for (std::size_t size = 20; size < 1481; ++size) {
      for (Frame frame : {make_frame(protocol, size), make_frame6(protocol, size)}) {
        ASSERT_TRUE(complete_checksum(frame));
        ASSERT_EQ(receiver_sum(frame, protocol), 0xffffU) << protocol << " " << size;
      }
    }
  }
}

TEST(Checksum, ZeroOfUdpIsSentAsAllOnes) {
  // A payload word chosen such that the sum is 0xffff, whose complement is 0.
  Frame frame = make_frame(17, 10);
  put16(frame, 42, 0);
  ASSERT_TRUE(complete_checksum(frame));
  put16(frame, 42, get16(frame, 40));
  ASSERT_TRUE(complete_checksum(frame));
  EXPECT_EQ(get16(frame, 40), 0xffffU);
}

TEST(Checksum, LeavesEthernetPaddingOut) {
  Frame frame = make_frame(17, 12);
  Frame padded = frame;
  padded.resize(60, std::byte{0xaa});
  ASSERT_TRUE(complete_checksum(frame));
  ASSERT_TRUE(complete_checksum(padded));
  EXPECT_EQ(get16(frame, 40), get16(padded, 40));
}

TEST(Checksum, LeavesWhatItDoesNotUnderstandAlone) {
  const auto untouched = [](Frame frame) {
    const Frame before = frame;
    return !complete_checksum(frame) && frame == before;
  };
  EXPECT_TRUE(untouched({}));
  EXPECT_TRUE(untouched(Frame(33)));
  EXPECT_TRUE(untouched(make_frame(1, 20)));  // ICMP
  EXPECT_TRUE(untouched(make_frame(17, 7)));  // too short for a header
  Frame arp = make_frame(17, 20);
  put16(arp, 12, 0x0806);
  EXPECT_TRUE(untouched(arp));
  Frame fragment = make_frame(17, 20);
  put16(fragment, 20, 0x2000);
  EXPECT_TRUE(untouched(fragment));
  Frame lying = make_frame(17, 20);
  put16(lying, 16, 60'000);
  EXPECT_TRUE(untouched(lying));
  EXPECT_TRUE(untouched(make_frame6(58, 20)));  // ICMPv6
  Frame lying6 = make_frame6(17, 20);
  put16(lying6, 18, 21);
  EXPECT_TRUE(untouched(lying6));
  Frame cut = make_frame6(17, 20);
  cut.resize(53);
  EXPECT_TRUE(untouched(cut));
}

}  // namespace
}  // namespace interneuron::netns::checksum_test
