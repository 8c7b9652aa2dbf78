#include "core/wire/packet.h"

#include <gtest/gtest.h>

#include <array>
#include <string>

#include "tests/core/wire/consistent.h"
#include "tests/core/wire/examples.h"

namespace interneuron::wire {
namespace {

constexpr std::size_t kRoom = 1400;
constexpr std::array kExamples{kDataExample, kFeedbackExample, kProbeExample, kEchoRequestExample,
                               kEchoReplyExample};

Bytes with(Bytes bytes, std::size_t at, int value) {
  bytes.at(at) = static_cast<std::byte>(value);
  return bytes;
}

// --- golden bytes

TEST(Packet, DataIsTheDocumentedExample) {
  Bytes out(kRoom);
  out.resize(write_data(out, example_header(PacketType::kData, LinkId{2}, 7), example_fragment(),
                        example_message()));
  EXPECT_EQ(out, from_hex(kDataExample));

  const auto packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, example_header(PacketType::kData, LinkId{2}, 7));
  EXPECT_EQ(packet->data.fragment, example_fragment());
  EXPECT_TRUE(std::ranges::equal(packet->data.bytes, example_message()));
}

TEST(Packet, FeedbackIsTheDocumentedExample) {
  Bytes out(kRoom);
  out.resize(write_feedback(out, example_header(PacketType::kFeedback, LinkId{1}, 300),
                            example_feedback()));
  EXPECT_EQ(out, from_hex(kFeedbackExample));

  const auto packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, example_header(PacketType::kFeedback, LinkId{1}, 300));
  EXPECT_EQ(packet->feedback, example_feedback());
}

TEST(Packet, ProbeIsTheDocumentedExample) {
  Bytes out(kRoom);
  out.resize(write_probe(out, example_header(PacketType::kProbe, LinkId{1}, 301), 40));
  EXPECT_EQ(out, from_hex(kProbeExample));

  const auto packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, example_header(PacketType::kProbe, LinkId{1}, 301));
}

TEST(Packet, EchoesAreTheDocumentedExamples) {
  PacketHeader header = example_header(PacketType::kEcho, LinkId{1}, 302);
  Bytes out(kRoom);
  out.resize(write_echo(out, header, example_echo_request(), 88));
  EXPECT_EQ(out, from_hex(kEchoRequestExample));
  auto packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, header);
  EXPECT_FALSE(packet->echo.is_reply);
  EXPECT_EQ(packet->echo.request, example_echo_request().request);

  header.session = SessionId{0xcafe0002};
  header.number = 21;
  out.resize(kRoom);
  out.resize(write_echo(out, header, example_echo_reply(), 88));
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
  constexpr std::size_t kDelayAt = 17;
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
  constexpr std::size_t kMultiplierAt = 16 + 8 + 13;
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

TEST(Packet, EpochReservedBytesAndTagAreFixed) {
  for (const std::string_view example : kExamples) {
    expect_fixed(example, {2, 3});
    const std::size_t size = from_hex(example).size();
    for (std::size_t i = 1; i <= kTagBytes; ++i) expect_fixed(example, {size - i});
  }
  expect_fixed(kDataExample, {26, 27});
  expect_fixed(kEchoRequestExample, {17});
  expect_fixed(kEchoReplyExample, {17});
  expect_fixed(kFeedbackExample, {28, 29, 30});
}

TEST(Packet, TheTypeIsOneOfFour) {
  const Bytes bytes = from_hex(kProbeExample);
  for (int type = 0; type < 256; ++type) {
    if (type >= 1 && type <= 4) continue;
    EXPECT_FALSE(parse(with(bytes, 0, type))) << type;
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
  for (const PieceCase& c : {
           PieceCase{"first of three", {MessageId{1}, 0, 3, 10, 1}, 10, true},
           PieceCase{"first of three, short", {MessageId{1}, 0, 3, 10, 1}, 9, false},
           PieceCase{"first of three, long", {MessageId{1}, 0, 3, 10, 1}, 11, false},
           PieceCase{"last, full", {MessageId{1}, 2, 3, 10, 1}, 10, true},
           PieceCase{"last, one byte", {MessageId{1}, 2, 3, 10, 1}, 1, true},
           PieceCase{"last, empty", {MessageId{1}, 2, 3, 10, 1}, 0, false},
           PieceCase{"last, long", {MessageId{1}, 2, 3, 10, 1}, 11, false},
           PieceCase{"behind the last", {MessageId{1}, 3, 3, 10, 1}, 10, false},
           PieceCase{"no pieces", {MessageId{1}, 0, 0, 10, 1}, 10, false},
           PieceCase{"no chunk", {MessageId{1}, 0, 2, 0, 1}, 0, false},
           PieceCase{"largest index", {MessageId{1}, 65534, 65535, 10, 1}, 10, true},
           PieceCase{"index behind the largest", {MessageId{1}, 65535, 65535, 10, 1}, 10, false},
           PieceCase{"no lifetime", {MessageId{1}, 0, 1, 10, 0}, 10, true},
       }) {
    Bytes out(kRoom);
    out.resize(write_data(out, example_header(PacketType::kData, LinkId{2}, 7), c.fragment,
                          Bytes(c.bytes)));
    EXPECT_EQ(parse(out).has_value(), c.valid) << c.name;
  }
}

Bytes feedback_with(std::size_t reports) {
  Feedback feedback = example_feedback();
  const LinkReport report = feedback.reports.front();
  feedback.reports = {};
  for (std::size_t i = 0; i < reports; ++i) feedback.reports.push_back(report);
  Bytes out(kRoom);
  out.resize(write_feedback(out, example_header(PacketType::kFeedback, LinkId{1}, 300), feedback));
  return out;
}

TEST(Packet, FeedbackHasAsManyReportsAsItSays) {
  constexpr std::size_t kCountAt = 31;
  for (std::size_t n = 0; n <= kMaxReports; ++n) {
    const Bytes bytes = feedback_with(n);
    for (int says = 0; says < 256; ++says) {
      EXPECT_EQ(parse(with(bytes, kCountAt, says)).has_value(), std::cmp_equal(says, n)) << n;
    }
  }
  Bytes nine = feedback_with(kMaxReports);
  nine.insert(nine.end() - kTagBytes, kReportBytes, std::byte{0});
  EXPECT_FALSE(parse(with(nine, kCountAt, 9)));
}

TEST(Packet, FeedbackOnEveryPathFitsTheSmallestDatagram) {
  constexpr std::size_t kIpv6MinimumMtu = 1280;
  constexpr std::size_t kIpv6UdpHeaders = 48;
  EXPECT_EQ(feedback_with(kMaxReports).size(), feedback_bytes(kMaxReports));
  EXPECT_LE(feedback_bytes(kMaxReports), kIpv6MinimumMtu - kIpv6UdpHeaders);
}

TEST(Packet, TheHoldingTimeOfAnExchangeIsNotNegative) {
  constexpr std::size_t kHoldingTimeAt = 48;
  const Bytes bytes = from_hex(kFeedbackExample);
  EXPECT_TRUE(parse(with(bytes, kHoldingTimeAt, 0x7f)));
  EXPECT_FALSE(parse(with(bytes, kHoldingTimeAt, 0x80)));
}

TEST(Packet, OnlyTwoFlagsOfAReportAreKnown) {
  constexpr std::size_t kFlagsAt = 33;
  const Bytes bytes = from_hex(kFeedbackExample);
  for (int flags = 0; flags < 256; ++flags) {
    EXPECT_EQ(parse(with(bytes, kFlagsAt, flags)).has_value(), flags <= 3) << flags;
  }
}

TEST(Packet, RatesTravelInKilobitsAndSaturate) {
  Feedback feedback = example_feedback();
  const auto across = [&feedback](std::int64_t bits_per_second) {
    feedback.reports.front().train_rate = {bits_per_second};
    feedback.reports.front().rate = {bits_per_second};
    Bytes out(kRoom);
    out.resize(
        write_feedback(out, example_header(PacketType::kFeedback, LinkId{1}, 300), feedback));
    const LinkReport report = parse(out)->feedback.reports.front();
    EXPECT_EQ(report.rate, report.train_rate);
    return report.train_rate.bits_per_second;
  };
  EXPECT_EQ(across(1'999), 1'000);
  EXPECT_EQ(across(999), 0);
  EXPECT_EQ(across(-5'000), 0);
  EXPECT_EQ(across(INT64_MAX), std::int64_t{UINT32_MAX} * 1'000);
}

}  // namespace
}  // namespace interneuron::wire
