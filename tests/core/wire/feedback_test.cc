#include "core/wire/feedback.h"

#include <gtest/gtest.h>

#include <utility>

#include "core/wire/packet.h"
#include "tests/core/wire/consistent.h"
#include "tests/core/wire/examples.h"

namespace interneuron::wire::feedback_test {
namespace {

constexpr std::size_t kRoom = kMaxDatagramBytes;

TEST(Packet, FeedbackIsTheDocumentedExample) {
  Bytes out(kRoom);
  const PacketHeader header = example_header(PacketType::kFeedback, LinkId{1}, 300, 1'234'600'000);
  out.resize(write_feedback(out, header, example_feedback()));
  EXPECT_EQ(out, from_hex(kFeedbackExample));

  const auto packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, header);
  EXPECT_EQ(packet->feedback, example_feedback());
}

Bytes feedback_with(std::size_t reports) {
  Feedback feedback = example_feedback();
  const LinkReport report = feedback.reports.front();
  feedback.reports = {};
  feedback.complete = {};
  feedback.refused = {};
  for (std::size_t i = 0; i < reports; ++i) feedback.reports.push_back(report);
  Bytes out(kRoom);
  out.resize(write_feedback(out, example_header(PacketType::kFeedback, LinkId{1}, 300), feedback));
  return out;
}

TEST(Packet, FeedbackHasAsManyReportsAsItSays) {
  constexpr std::size_t kCountAt = 34;
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

TEST(Packet, FeedbackHasAsManyMessagesAsItSays) {
  const Bytes bytes = from_hex(kFeedbackExample);
  constexpr std::size_t kCompleteAt = 35;
  constexpr std::size_t kRefusedAt = 36;
  // The example has 16 bytes that say what is complete and 4 that say what is refused; other counts
  // that need these 20 bytes are valid too.
  for (int complete = 0; complete < 256; ++complete) {
    for (int refused = 0; refused < 256; ++refused) {
      const Bytes changed = with(with(bytes, kCompleteAt, complete), kRefusedAt, refused);
      EXPECT_EQ(parse(changed).has_value(), 8 * complete + 4 * refused == 20);
    }
  }
  Feedback most = example_feedback();
  most.reports = {};
  for (std::uint32_t i = 0; i < kMaxComplete; ++i) most.complete.push_back({MessageId{i}, i});
  for (std::uint32_t i = 0; i < kMaxRefused; ++i) most.refused.push_back(MessageId{i});
  Bytes out(kRoom);
  const PacketHeader header = example_header(PacketType::kFeedback, LinkId{1}, 300);
  out.resize(write_feedback(out, header, most));
  EXPECT_EQ(out.size(), feedback_bytes(0, kMaxComplete, kMaxRefused));
  ASSERT_TRUE(parse(out));
  EXPECT_EQ(parse(out)->feedback, most);
  Bytes more = out;
  more.insert(more.end() - kTagBytes, kCompleteBytes, std::byte{0});
  EXPECT_FALSE(parse(with(more, kCompleteAt, kMaxComplete + 1)));
  more = out;
  more.insert(more.end() - kTagBytes, kRefusedBytes, std::byte{0});
  EXPECT_FALSE(parse(with(more, kRefusedAt, kMaxRefused + 1)));
}

TEST(Packet, FeedbackOnEveryPathFitsTheSmallestDatagram) {
  constexpr std::size_t kIpv6MinimumMtu = 1280;
  constexpr std::size_t kIpv6UdpHeaders = 48;
  EXPECT_EQ(feedback_with(kMaxReports).size(), feedback_bytes(kMaxReports));
  EXPECT_LE(feedback_bytes(kMaxReports, kMaxComplete, kMaxRefused),
            kIpv6MinimumMtu - kIpv6UdpHeaders);
}

TEST(Packet, TheHoldingTimeOfAnExchangeIsNotNegative) {
  constexpr std::size_t kHoldingTimeAt = 20 + 17 + 17;
  const Bytes bytes = from_hex(kFeedbackExample);
  EXPECT_TRUE(parse(with(bytes, kHoldingTimeAt, 0x7f)));
  EXPECT_FALSE(parse(with(bytes, kHoldingTimeAt, 0x80)));
}

TEST(Packet, OnlyThreeFlagsOfAReportAreKnown) {
  constexpr std::size_t kFlagsAt = 20 + 17 + 2;
  const Bytes bytes = from_hex(kFeedbackExample);
  for (int flags = 0; flags < 256; ++flags) {
    EXPECT_EQ(parse(with(bytes, kFlagsAt, flags)).has_value(), flags <= 7) << flags;
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
}  // namespace interneuron::wire::feedback_test
