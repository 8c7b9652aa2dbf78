#include "node/ring/frame.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include "node/io/address.h"
#include "support.h"
#include "two_hosts.h"

namespace interneuron::io::frame_test {
namespace {

FrameAddresses some(bool ipv6, bool ethernet) {
  FrameAddresses out;
  if (ethernet) out.ethernet = EthernetHeader{.to = {std::byte{2}}, .from = {std::byte{6}}};
  out.from = *parse_address(ipv6 ? "[fd00::1]:4000" : "10.0.0.1:4000");
  out.to = *parse_address(ipv6 ? "[fd00::2]:5000" : "10.0.0.2:5000");
  return out;
}

std::string outcome(ByteView frame, const FrameContext& context = {}) {
  const auto result = parse_frame(frame, context);
  if (const auto* problem = std::get_if<FrameProblem>(&result)) {
    return std::string(name_of(*problem));
  }
  return "fine";
}

void set16(Bytes& frame, std::size_t at, unsigned value) {
  frame[at] = static_cast<std::byte>(value >> 8);
  frame[at + 1] = static_cast<std::byte>(value & 0xff);
}

// Makes the checksum of an IPv4 header that begins at `at` right again.
void fix_ipv4(Bytes& frame, std::size_t at, std::size_t bytes = 20) {
  set16(frame, at + 10, 0);
  unsigned sum = 0;
  for (std::size_t i = 0; i < bytes; i += 2) {
    sum += std::to_integer<unsigned>(frame[at + i]) << 8 |
           std::to_integer<unsigned>(frame[at + i + 1]);
  }
  while (sum >> 16 != 0) sum = (sum & 0xffff) + (sum >> 16);
  set16(frame, at + 10, ~sum & 0xffff);
}

Bytes with_tags(const Bytes& frame, const std::vector<std::pair<unsigned, unsigned>>& tags) {
  Bytes out(frame.begin(), frame.begin() + 12);
  for (const auto& [type, tci] : tags) {
    out.resize(out.size() + 4);
    set16(out, out.size() - 4, type);
    set16(out, out.size() - 2, tci);
  }
  out.insert(out.end(), frame.begin() + 12, frame.end());
  return out;
}

// 10.0.0.1:4000 to 10.0.0.2:5000, "ab", with ECN 2. The UDP checksum by hand: the words of the
// pseudo header, the header and the payload come to 98b2, the complement of which is 674d.
TEST(Frame, BytesAreThoseOfTheStandards) {
  FrameAddresses addresses = some(false, true);
  addresses.ecn = 2;
  const Bytes frame = whole_frame(addresses, {std::byte{'a'}, std::byte{'b'}});
  const std::vector<unsigned> expected = {
      2,    0,    0,    0,    0, 0,  6,    0,    0,   0,  0,    0,    0x08, 0x00,  // Ethernet
      0x45, 0x02, 0,    30,   0, 0,  0x40, 0,    64,  17, 0x26, 0xcb, 10,   0,
      0,    1,    10,   0,    0, 2,                          // IPv4
      0x0f, 0xa0, 0x13, 0x88, 0, 10, 0x67, 0x4d, 'a', 'b'};  // UDP
  ASSERT_EQ(frame.size(), expected.size());
  for (std::size_t i = 0; i < frame.size(); ++i) {
    EXPECT_EQ(std::to_integer<unsigned>(frame[i]), expected[i]) << i;
  }
}

RC_GTEST_PROP(Frame, WhatIsBuiltIsReadBack, ()) {
  const bool ipv6 = *rc::gen::arbitrary<bool>();
  FrameAddresses addresses = some(ipv6, *rc::gen::arbitrary<bool>());
  addresses.ecn = *rc::gen::inRange<std::uint8_t>(0, 4);
  addresses.from = with_port(addresses.from, *rc::gen::arbitrary<std::uint16_t>());
  if (addresses.ethernet && *rc::gen::arbitrary<bool>()) {
    // A priority without a VLAN.
    addresses.ethernet->tag = static_cast<std::uint16_t>(*rc::gen::inRange(0, 8) << 13);
  }
  const Bytes bytes =
      payload(*rc::gen::arbitrary<std::uint8_t>(), *rc::gen::inRange<std::size_t>(0, 3000));
  Bytes frame = whole_frame(addresses, bytes);
  // Ethernet pads short frames.
  frame.resize(frame.size() + *rc::gen::inRange<std::size_t>(0, 40));
  const auto result = parse_frame(frame, {.ethernet = addresses.ethernet.has_value()});
  const auto* parsed = std::get_if<ParsedFrame>(&result);
  RC_ASSERT(parsed != nullptr);
  RC_ASSERT(parsed->from == addresses.from);
  RC_ASSERT(parsed->to == addresses.to);
  RC_ASSERT(parsed->ecn == addresses.ecn);
  RC_ASSERT(std::ranges::equal(parsed->payload, bytes));
}

RC_GTEST_PROP(Frame, ThePartsOfAPayloadDoNotMatterToItsChecksum, ()) {
  const FrameAddresses addresses = some(*rc::gen::arbitrary<bool>(), true);
  const Bytes bytes = payload(1, *rc::gen::inRange<std::size_t>(0, 200));
  const auto cut = *rc::gen::inRange<std::size_t>(0, bytes.size() + 1);
  const auto second = *rc::gen::inRange<std::size_t>(cut, bytes.size() + 1);
  FrameHeader header = build_header(addresses, bytes.size()).value();
  const ByteView all(bytes);
  const std::array parts = {all.first(cut), all.subspan(cut, second - cut), all.subspan(second)};
  complete_checksum(header, parts);
  RC_ASSERT(std::ranges::equal(header.view(),
                               ByteView(whole_frame(addresses, bytes)).first(header.size)));
}

// Whatever a stranger changes, cuts off or appends: the reading stays within the frame, and no
// changed byte that the UDP checksum covers goes unnoticed.
RC_GTEST_PROP(Frame, OneChangedByteIsNoticedOrHarmless, ()) {
  const bool ethernet = *rc::gen::arbitrary<bool>();
  const FrameAddresses addresses = some(*rc::gen::arbitrary<bool>(), ethernet);
  const Bytes bytes = payload(7, *rc::gen::inRange<std::size_t>(1, 300));
  const Bytes frame = whole_frame(addresses, bytes);
  Bytes changed = frame;
  const auto at = *rc::gen::inRange<std::size_t>(0, frame.size());
  changed[at] ^= static_cast<std::byte>(*rc::gen::inRange(1, 256));
  const auto result = parse_frame(changed, {.ethernet = ethernet});
  const auto* parsed = std::get_if<ParsedFrame>(&result);
  if (parsed == nullptr) return;
  RC_ASSERT(parsed->from == addresses.from);
  RC_ASSERT(parsed->to == addresses.to);
  RC_ASSERT(std::ranges::equal(parsed->payload, bytes));
}

RC_GTEST_PROP(Frame, AnyBytesAreReadWithinTheirBounds, ()) {
  const auto ethernet = *rc::gen::arbitrary<bool>();
  Bytes frame = whole_frame(some(*rc::gen::arbitrary<bool>(), ethernet), payload(3, 60));
  const auto changes = *rc::gen::inRange(0, 12);
  for (int i = 0; i < changes; ++i) {
    frame[*rc::gen::inRange<std::size_t>(0, frame.size())] =
        static_cast<std::byte>(*rc::gen::inRange(0, 256));
  }
  // A buffer of its own size, so that a sanitizer sees what reads beyond it.
  const auto size = *rc::gen::inRange<std::size_t>(0, frame.size() + 1);
  const Bytes cut(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(size));
  const auto result = parse_frame(cut, {.ethernet = ethernet, .checksum_known = changes % 2 == 0});
  if (const auto* parsed = std::get_if<ParsedFrame>(&result)) {
    RC_ASSERT(parsed->payload.data() >= cut.data());
    RC_ASSERT(parsed->payload.data() + parsed->payload.size() <= cut.data() + cut.size());
  }
}

TEST(Frame, CutAnywhereItIsTruncated) {
  for (const bool ipv6 : {false, true}) {
    const Bytes frame = whole_frame(some(ipv6, true), payload(1, 50));
    for (std::size_t size = 0; size < frame.size(); ++size) {
      EXPECT_EQ(outcome(ByteView(frame).first(size)), "truncated") << size;
    }
  }
}

TEST(Frame, TagsOfNoVlanAreSkippedAndThoseOfOneRefused) {
  const Bytes frame = whole_frame(some(false, true), payload(1, 50));
  EXPECT_EQ(outcome(with_tags(frame, {{0x8100, 0xe000}})), "fine");
  EXPECT_EQ(outcome(with_tags(frame, {{0x88a8, 0}, {0x8100, 0x2000}})), "fine");
  EXPECT_EQ(outcome(with_tags(frame, {{0x8100, 5}})), "VLAN");
  EXPECT_EQ(outcome(with_tags(frame, {{0x88a8, 0}, {0x8100, 7}})), "VLAN");
  EXPECT_EQ(outcome(with_tags(frame, {4, {0x8100, 0}})), "VLAN");
  const Bytes tagged = with_tags(frame, {{0x8100, 0}});
  EXPECT_EQ(outcome(ByteView(tagged).first(17)), "truncated");
}

TEST(Frame, OptionsOfIpv4AreSkipped) {
  const Bytes plain = whole_frame(some(false, true), payload(1, 50));
  Bytes frame(plain.begin(), plain.begin() + 34);
  frame.resize(46, std::byte{1});  // 12 bytes of "no operation"
  frame.insert(frame.end(), plain.begin() + 34, plain.end());
  frame[14] = std::byte{0x48};
  set16(frame, 16, 32 + 58);
  fix_ipv4(frame, 14, 32);
  EXPECT_EQ(outcome(frame), "fine");
  frame[14] = std::byte{0x44};  // 16 bytes, less than a header has
  EXPECT_EQ(outcome(frame), "length");
}

TEST(Frame, LengthsThatLieAreRefused) {
  const Bytes good = whole_frame(some(false, true), payload(1, 50));
  const auto ipv4_total = [&](unsigned total) {
    Bytes frame = good;
    set16(frame, 16, total);
    fix_ipv4(frame, 14);
    return outcome(frame);
  };
  EXPECT_EQ(ipv4_total(19), "length");
  EXPECT_EQ(ipv4_total(20), "UDP length");
  EXPECT_EQ(ipv4_total(27), "UDP length");
  EXPECT_EQ(ipv4_total(77), "UDP length");
  EXPECT_EQ(ipv4_total(78), "fine");
  EXPECT_EQ(ipv4_total(79), "truncated");
  const auto udp_length = [&](unsigned length) {
    Bytes frame = good;
    set16(frame, 38, length);
    return outcome(frame, {.checksum_known = true});
  };
  EXPECT_EQ(udp_length(0), "UDP length");
  EXPECT_EQ(udp_length(7), "UDP length");
  EXPECT_EQ(udp_length(8), "fine");
  EXPECT_EQ(udp_length(59), "UDP length");
  Bytes jumbo = whole_frame(some(true, true), payload(1, 50));
  set16(jumbo, 18, 0);
  EXPECT_EQ(outcome(jumbo), "UDP length");
}

TEST(Frame, FragmentsAreRefused) {
  Bytes ipv4 = whole_frame(some(false, true), payload(1, 50));
  for (const unsigned word : {0x2000U, 0x0001U, 0x3fffU}) {
    set16(ipv4, 20, word);
    fix_ipv4(ipv4, 14);
    EXPECT_EQ(outcome(ipv4), "fragment") << word;
  }
  Bytes ipv6 = whole_frame(some(true, true), payload(1, 50));
  ipv6[20] = std::byte{44};
  EXPECT_EQ(outcome(ipv6), "fragment");
}

TEST(Frame, ChecksumsAreHeldAgainstTheBytes) {
  for (const bool is6 : {false, true}) {
    Bytes frame = whole_frame(some(is6, true), payload(1, 50));
    const std::size_t udp = is6 ? 54 : 34;
    frame.back() ^= std::byte{1};
    EXPECT_EQ(outcome(frame), "UDP checksum");
    EXPECT_EQ(outcome(frame, {.checksum_known = true}), "fine");
    set16(frame, udp + 6, 0);
    EXPECT_EQ(outcome(frame), is6 ? "UDP checksum" : "fine") << "none was computed";
  }
  Bytes ipv4 = whole_frame(some(false, true), payload(1, 50));
  ipv4[22] = std::byte{9};
  EXPECT_EQ(outcome(ipv4, {.checksum_known = true}), "IP checksum");
}

TEST(Frame, OtherProtocolsAndVersionsAreRefused) {
  Bytes ipv4 = whole_frame(some(false, true), payload(1, 50));
  set16(ipv4, 12, 0x86dd);
  EXPECT_EQ(outcome(ipv4), "not IP");
  set16(ipv4, 12, 0x0806);
  EXPECT_EQ(outcome(ipv4), "not IP");
  set16(ipv4, 12, 0x0800);
  ipv4[23] = std::byte{6};
  fix_ipv4(ipv4, 14);
  EXPECT_EQ(outcome(ipv4), "not UDP");
  Bytes ipv6 = whole_frame(some(true, false), payload(1, 50));
  ipv6[6] = std::byte{0};
  EXPECT_EQ(outcome(ipv6, {.ethernet = false}), "not UDP");
}

TEST(Frame, AddressesThatNobodySendsFromAreRefused) {
  for (const char* host : {"0.0.0.0", "0.1.2.3", "127.0.0.1", "224.0.0.1", "255.255.255.255",
                           "::", "::1", "ff02::1"}) {
    FrameAddresses addresses =
        some(std::string_view(host).find(':') != std::string_view::npos, true);
    addresses.from = *make_address(host, 4000);
    EXPECT_EQ(outcome(whole_frame(addresses, payload(1, 50))), "source") << host;
  }
  FrameAddresses loopback = some(false, true);
  loopback.from = *make_address("127.0.0.1", 4000);
  EXPECT_EQ(outcome(whole_frame(loopback, payload(1, 50)), {.loopback = true}), "fine");
}

TEST(Frame, LinkLocalAddressesAreOfTheirDevice) {
  FrameAddresses addresses = some(true, true);
  addresses.from = *make_address("fe80::1%7", 4000);
  const auto result = parse_frame(whole_frame(addresses, payload(1, 50)), {.device = 7});
  ASSERT_TRUE(std::holds_alternative<ParsedFrame>(result));
  EXPECT_EQ(std::get<ParsedFrame>(result).from, addresses.from);
}

TEST(Frame, WhatCannotBeBuiltIsNothing) {
  FrameAddresses addresses = some(false, true);
  EXPECT_TRUE(build_header(addresses, 65507));
  EXPECT_FALSE(build_header(addresses, 65508));
  addresses.from = some(true, true).from;
  EXPECT_FALSE(build_header(addresses, 10));
  EXPECT_FALSE(build_header({}, 10));
}

}  // namespace
}  // namespace interneuron::io::frame_test
