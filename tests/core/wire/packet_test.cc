#include "core/wire/packet.h"

#include <gtest/gtest.h>

#include "tests/core/wire/consistent.h"
#include "tests/core/wire/examples.h"

namespace interneuron::wire::packet_test {
namespace {

constexpr std::size_t kRoom = kMaxDatagramBytes;
constexpr std::array kExamples{
    kDataExample,        kPlainExample,     kRepairExample, kFeedbackExample,  kProbeExample,
    kEchoRequestExample, kEchoReplyExample, kWindowExample, kChallengeExample, kTokenExample};

// --- golden bytes

void expect_data(std::string_view example, std::uint64_t number, const FragmentHeader& fragment,
                 const Bytes& bytes) {
  const PacketHeader header = example_header(PacketType::kData, LinkId{2}, number, kExampleStamp);
  Bytes out(kRoom);
  out.resize(write_data(out, header, fragment, bytes));
  EXPECT_EQ(out, from_hex(example));

  const auto packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, header);
  EXPECT_EQ(packet->data.fragment, fragment);
  EXPECT_TRUE(std::ranges::equal(packet->data.bytes, bytes));
}

TEST(Packet, DataIsTheDocumentedExample) {
  expect_data(kDataExample, 7, example_fragment(), example_message());
}

TEST(Packet, APlainMessageIsTheDocumentedExample) {
  expect_data(kPlainExample, 8, example_plain_fragment(), example_plain_message());
}

TEST(Packet, ARepairSymbolIsTheDocumentedExample) {
  ASSERT_TRUE(example_repair_fragment().is_repair());
  expect_data(kRepairExample, 9, example_repair_fragment(), from_hex("00c786794c94aefb"));
}

TEST(Packet, AChallengeIsTheDocumentedExample) {
  const PacketHeader header{PacketType::kChallenge, LinkId{1}, 0, SessionId{0xcafe0002}, 300};
  const Challenge challenge{SessionId{0x5eed0001}, example_token()};
  Bytes out(kRoom);
  out.resize(write_challenge(out, header, challenge));
  EXPECT_EQ(out, from_hex(kChallengeExample));
  const auto packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, header);
  EXPECT_EQ(packet->challenge, challenge);
}

TEST(Packet, ATokenIsTheDocumentedExample) {
  const Bytes expected = from_hex(kTokenExample);
  const auto packet = parse(expected);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header.type, PacketType::kToken);
  EXPECT_EQ(packet->header.number, 303U);
  EXPECT_EQ(packet->token, example_token());
  Bytes out(kRoom);
  out.resize(write_token(out, packet->header, packet->token));
  EXPECT_EQ(out, expected);
}

TEST(Packet, ProbeIsTheDocumentedExample) {
  Bytes out(kRoom);
  const PacketHeader header = example_header(PacketType::kProbe, LinkId{1}, 301, 1'234'600'100);
  out.resize(write_probe(out, header, 44));
  EXPECT_EQ(out, from_hex(kProbeExample));

  const auto packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, header);
}

TEST(Packet, EchoesAreTheDocumentedExamples) {
  PacketHeader header = example_header(PacketType::kEcho, LinkId{1}, 302);
  Bytes out(kRoom);
  out.resize(write_echo(out, header, example_echo_request(), 108));
  EXPECT_EQ(out, from_hex(kEchoRequestExample));
  auto packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, header);
  EXPECT_FALSE(packet->echo.is_reply);
  EXPECT_EQ(packet->echo.request, example_echo_request().request);

  header.session = SessionId{0xcafe0002};
  header.number = 21;
  out.resize(kRoom);
  out.resize(write_echo(out, header, example_echo_reply(), 108));
  EXPECT_EQ(out, from_hex(kEchoReplyExample));
  packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, header);
  EXPECT_TRUE(packet->echo.is_reply);
  EXPECT_EQ(packet->echo.reply, example_echo_reply().reply);
}

TEST(Packet, AnEchoIsNeverSmallerThanItsFields) {
  Bytes out(kRoom);
  const PacketHeader header = example_header(PacketType::kEcho, LinkId{1}, 1);
  EXPECT_EQ(write_echo(out, header, example_echo_request(), 0), kEchoBytes);
  EXPECT_TRUE(parse(ByteView(out).first(kEchoBytes)));
  EXPECT_FALSE(parse(ByteView(out).first(kEchoBytes - 1)));
}

struct TrainCase {
  const char* name;
  bool hold;
  std::uint16_t train, index, count;
  bool valid;
};

TEST(Packet, AnEchoIsAloneOrInAWholeTrain) {
  for (const TrainCase& c : {
           TrainCase{"alone", false, 0, 0, 0, true},
           TrainCase{"alone, held", true, 0, 0, 0, false},
           TrainCase{"no train, but an index", false, 0, 1, 0, false},
           TrainCase{"no train, but a count", false, 0, 0, 2, false},
           TrainCase{"first of two", false, 1, 0, 2, true},
           TrainCase{"last of the longest", true, 65535, 255, 256, true},
           TrainCase{"behind the last", true, 1, 2, 2, false},
           TrainCase{"a train of one", true, 1, 0, 1, false},
           TrainCase{"too long", true, 1, 0, 257, false},
       }) {
    Echo echo = example_echo_request();
    echo.hold = c.hold;
    echo.train = c.train;
    echo.index = c.index;
    echo.count = c.count;
    Bytes out(kRoom);
    out.resize(write_echo(out, example_header(PacketType::kEcho, LinkId{1}, 1), echo, 0));
    EXPECT_EQ(parse(out).has_value(), c.valid) << c.name;
  }
}

TEST(Packet, OnlyAnEchoInNoTrainMayAskForALaterReply) {
  const PacketHeader header = example_header(PacketType::kEcho, LinkId{1}, 1);
  constexpr std::size_t kDelayAt = kHeaderBytes + 1;
  for (const bool is_reply : {false, true}) {
    for (const auto delay : std::initializer_list<std::uint8_t>{0, 1, 240, 255}) {
      Echo echo;
      echo.is_reply = is_reply;
      echo.delay = delay;
      Bytes out(kRoom);
      out.resize(write_echo(out, header, echo, 0));
      EXPECT_EQ(out.at(kDelayAt), static_cast<std::byte>(delay));
      const auto packet = parse(out);
      ASSERT_TRUE(packet);
      EXPECT_EQ(packet->echo.delay, delay);
      echo.train = 1;
      echo.count = 2;
      out.resize(kRoom);
      out.resize(write_echo(out, header, echo, 0));
      EXPECT_EQ(parse(out).has_value(), delay == 0);
    }
  }
}

TEST(Packet, TheErrorOfAnEchosClockIsNotZero) {
  constexpr std::size_t kMultiplierAt = kHeaderBytes + 8 + 13;
  EXPECT_FALSE(parse(with(from_hex(kEchoRequestExample), kMultiplierAt, 0)));
  EXPECT_FALSE(parse(with(from_hex(kEchoReplyExample), kMultiplierAt, 0)));
  EXPECT_FALSE(parse(with(from_hex(kEchoReplyExample), kMultiplierAt + 24, 0)));
}

TEST(Packet, ProbeIsNeverSmallerThanHeaderAndTag) {
  Bytes out(kRoom);
  EXPECT_EQ(write_probe(out, example_header(PacketType::kProbe, LinkId{1}, 1), 0), kPacketOverhead);
  EXPECT_TRUE(parse(ByteView(out).first(kPacketOverhead)));
}

// --- what is refused

// Sockets take in up to 64 KiB, and some links carry 9,000 bytes at once.
TEST(Packet, NoPacketIsLongerThanTheLargestThatIsEverSent) {
  Bytes out(UINT16_MAX);
  const auto probe = [&out](std::size_t size) {
    const PacketHeader header = example_header(PacketType::kProbe, LinkId{1}, 1);
    return parse(ByteView(out).first(write_probe(out, header, size))).has_value();
  };
  EXPECT_TRUE(probe(kMaxDatagramBytes));
  EXPECT_FALSE(probe(kMaxDatagramBytes + 1));
  EXPECT_FALSE(probe(UINT16_MAX));
  const auto symbol = [&out](std::uint16_t chunk) {
    const FragmentHeader fragment{
        MessageId{1}, 2, chunk, std::uint32_t{chunk} * 2, std::uint32_t{1000}, MessageKind::kPlain};
    const PacketHeader header = example_header(PacketType::kData, LinkId{1}, 1);
    return parse(ByteView(out).first(write_data(out, header, fragment, Bytes(chunk)))).has_value();
  };
  EXPECT_TRUE(symbol(kMaxPieceBytes));
  EXPECT_FALSE(symbol(kMaxPieceBytes + 1));
  EXPECT_FALSE(symbol(20'000));
}

TEST(Packet, EveryTruncationOfTheExamplesIsRefusedOrValid) {
  for (const std::string_view example : kExamples) {
    const Bytes bytes = from_hex(example);
    for (std::size_t n = 0; n < bytes.size(); ++n) {
      const ByteView shorter = ByteView(bytes).first(n);
      EXPECT_TRUE(refused_or_consistent(shorter)) << n;
      // A shorter probe is another probe, and zeros in a piece may pass for its tag.
      const bool must_be_refused = n < kPacketOverhead || example == kFeedbackExample;
      EXPECT_FALSE(must_be_refused && parse(shorter)) << n;
    }
  }
}

TEST(Packet, EveryChangeOfOneByteOfTheExamplesIsRefusedOrValid) {
  for (const std::string_view example : kExamples) {
    Bytes bytes = from_hex(example);
    for (std::byte& b : bytes) {
      const std::byte before = b;
      for (int value = 0; value < 256; ++value) {
        b = static_cast<std::byte>(value);
        EXPECT_TRUE(refused_or_consistent(bytes)) << (&b - bytes.data()) << " := " << value;
      }
      b = before;
    }
  }
}

// No value but the one in the example is allowed at these offsets.
void expect_fixed(std::string_view example, std::initializer_list<std::size_t> offsets) {
  const Bytes bytes = from_hex(example);
  for (const std::size_t at : offsets) {
    for (int value = 0; value < 256; ++value) {
      const Bytes changed = with(bytes, at, value);
      EXPECT_EQ(parse(changed).has_value(), changed == bytes) << at << " := " << value;
    }
  }
}

TEST(Packet, EpochAndTagAreFixed) {
  for (const std::string_view example : kExamples) {
    expect_fixed(example, {1});
    const std::size_t size = from_hex(example).size();
    for (std::size_t i = 1; i <= kTagBytes; ++i) expect_fixed(example, {size - i});
  }
  expect_fixed(kEchoRequestExample, {21});
  expect_fixed(kEchoReplyExample, {21});
  expect_fixed(kFeedbackExample, {34, 35, 36});
}

TEST(Packet, OfTypesThatAreNotUsedOnlyTheHeaderIsRead) {
  const Bytes bytes = from_hex(kProbeExample);
  for (int first = 0; first < 256; ++first) {
    const auto packet = parse(with(bytes, 0, first));
    // The body of a probe makes no data, no feedback, no echo and no window.
    EXPECT_EQ(packet.has_value(),
              first == 0x33 || first == 0x35 || (first >= 0x39 && first <= 0x3f))
        << first;
    if (!packet) continue;
    EXPECT_EQ(static_cast<int>(packet->header.type), first & 0x0f);
    EXPECT_EQ(is_used(packet->header.type), first == 0x33);
  }
}

TEST(Packet, SessionAndNumberAreNotZero) {
  Bytes bytes = from_hex(kProbeExample);
  std::fill_n(bytes.begin() + 4, 4, std::byte{0});
  EXPECT_FALSE(parse(bytes));
  bytes = from_hex(kProbeExample);
  std::fill_n(bytes.begin() + 8, 8, std::byte{0});
  EXPECT_FALSE(parse(bytes));
}

struct PieceCase {
  const char* name;
  FragmentHeader fragment;
  std::size_t bytes;
  bool valid;
};

TEST(Packet, APieceMustFitItsMessage) {
  constexpr MessageId kId{1};
  constexpr auto kPlain = MessageKind::kPlain;
  constexpr std::uint32_t kMost = 65'535 * 10;
  for (const PieceCase& c : {
           PieceCase{"first of three", {kId, 0, 10, 21, 1}, 10, true},
           PieceCase{"first of three, short", {kId, 0, 10, 21, 1}, 9, false},
           PieceCase{"first of three, long", {kId, 0, 10, 21, 1}, 11, false},
           PieceCase{"last, full", {kId, 2, 10, 30, 1}, 10, true},
           PieceCase{"last, one byte", {kId, 2, 10, 21, 1}, 1, true},
           PieceCase{"last, empty", {kId, 2, 10, 21, 1}, 0, false},
           PieceCase{"last, long", {kId, 2, 10, 21, 1}, 2, false},
           PieceCase{"no message", {kId, 0, 10, 0, 1}, 0, false},
           PieceCase{"no chunk", {kId, 0, 0, 20, 1}, 0, false},
           PieceCase{"largest index", {kId, 65534, 10, kMost, 1}, 10, true},
           PieceCase{"one piece too many", {kId, 0, 10, kMost + 1, 1}, 10, false},
           PieceCase{"largest claim", {kId, 0, 10, UINT32_MAX, 1}, 10, false},
           PieceCase{"no lifetime", {kId, 0, 10, 10, 0}, 10, true},
           PieceCase{"repair", {kId, 3, 10, 21, 1, kPlain}, 10, true},
           PieceCase{"repair, short", {kId, 3, 10, 21, 1, kPlain}, 9, false},
           PieceCase{"repair of the last row", {kId, 57, 10, 21, 1, kPlain}, 10, true},
           PieceCase{"repair of no row", {kId, 58, 10, 21, 1, kPlain}, 10, false},
           PieceCase{"repair of the second block", {kId, 310, 10, 2010, 1, kPlain}, 10, true},
           PieceCase{
               "repair of no row of the second block", {kId, 311, 10, 2010, 1, kPlain}, 10, false},
           PieceCase{"no such kind", {kId, 0, 10, 10, 1, MessageKind{3}}, 10, false},
       }) {
    Bytes out(kRoom);
    // A chunk of 0 has no number of pieces to write by.
    FragmentHeader fragment = c.fragment;
    fragment.chunk = std::max<std::uint16_t>(fragment.chunk, 1);
    out.resize(
        write_data(out, example_header(PacketType::kData, LinkId{2}, 7), fragment, Bytes(c.bytes)));
    constexpr std::size_t kChunkAt = kHeaderBytes + 8;
    if (c.fragment.chunk == 0) out = with(with(out, kChunkAt, 0), kChunkAt + 1, 0);
    EXPECT_EQ(parse(out).has_value(), c.valid) << c.name;
  }
}

}  // namespace
}  // namespace interneuron::wire::packet_test
