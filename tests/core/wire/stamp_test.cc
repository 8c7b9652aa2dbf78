#include "core/wire/stamp.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include "tests/core/wire/examples.h"

namespace interneuron::wire::stamp_test {
namespace {

// Written out from the figures of RFC 8762 §4.2.1 and §4.3.1, field by field.
constexpr std::string_view kRequest =
    "00 00 00 07"              // Sequence Number
    "e9 00 00 01 40 00 00 00"  // Timestamp
    "16 01"                    // Error Estimate
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00";
constexpr std::string_view kReply =
    "00 00 00 05"              // Sequence Number
    "e9 00 00 01 60 00 00 00"  // Timestamp
    "16 01 00 00"              // Error Estimate, MBZ
    "e9 00 00 01 50 00 00 00"  // Receive Timestamp
    "00 00 00 07"              // Session-Sender Sequence Number
    "e9 00 00 01 40 00 00 00"  // Session-Sender Timestamp
    "16 01 00 00"              // Session-Sender Error Estimate, MBZ
    "40 00 00 00";             // Ses-Sender TTL, MBZ

StampReply example_reply() {
  StampReply reply = stamp_reply_to({7, 0xe9000001'40000000, kStampUnsynchronised}, 64);
  reply.sequence = 5;
  reply.sent = 0xe9000001'60000000;
  reply.received = 0xe9000001'50000000;
  return reply;
}

TEST(Stamp, RequestAndReplyAreThoseOfTheRfc) {
  Bytes out(100);
  const StampRequest request{7, 0xe9000001'40000000, kStampUnsynchronised};
  out.resize(write_stamp_request(out, request, 0));
  EXPECT_EQ(out, from_hex(kRequest));
  EXPECT_EQ(parse_stamp_request(out), request);

  out.resize(100);
  out.resize(write_stamp_reply(out, example_reply(), {}));
  EXPECT_EQ(out, from_hex(kReply));
  EXPECT_EQ(parse_stamp_reply(out), example_reply());
}

TEST(Stamp, AReplyHasTheRequestsSizeAndWhatItHadBehindTheBase) {
  Bytes request = from_hex(kRequest);
  for (int i = 0; i < 20; ++i) request.push_back(static_cast<std::byte>(i));
  ASSERT_TRUE(parse_stamp_request(request));
  const ByteView beyond = ByteView(request).subspan(kStampBytes);
  Bytes out(100);
  out.resize(write_stamp_reply(out, example_reply(), beyond));
  EXPECT_EQ(out.size(), request.size());
  EXPECT_TRUE(std::ranges::equal(ByteView(out).subspan(kStampBytes), beyond));
  EXPECT_EQ(write_stamp_request(std::span(out.begin(), 64), {}, 64), 64U);
}

TEST(Stamp, WhatIsTooShortOrHasNoErrorEstimateIsRefused) {
  const Bytes request = from_hex(kRequest);
  const Bytes reply = from_hex(kReply);
  for (std::size_t n = 0; n < kStampBytes; ++n) {
    EXPECT_FALSE(parse_stamp_request(ByteView(request).first(n))) << n;
    EXPECT_FALSE(parse_stamp_reply(ByteView(reply).first(n))) << n;
  }
  for (const std::size_t at : {13U, 37U}) {  // the multipliers
    Bytes bad = reply;
    bad[at] = std::byte{0};
    EXPECT_FALSE(parse_stamp_reply(bad)) << at;
  }
  Bytes bad = request;
  bad[13] = std::byte{0};
  EXPECT_FALSE(parse_stamp_request(bad));
}

TEST(Stamp, WhatMustBeZeroIsIgnoredWhenRead) {
  Bytes reply = from_hex(kReply);
  for (const std::size_t at : {14U, 15U, 38U, 39U, 41U, 42U, 43U}) reply[at] = std::byte{0xff};
  EXPECT_EQ(parse_stamp_reply(reply), example_reply());
}

TEST(Stamp, PtpTimesCountNanoseconds) {
  const StampTime a = (StampTime{100} << 32) | 5;
  const StampTime b = (StampTime{99} << 32) | 999'999'999;
  EXPECT_EQ(stamp_difference(a, b, kStampPtp | 1), Duration{6});
  EXPECT_EQ(stamp_difference(b, a, kStampPtp | 1), Duration{-6});
}

TEST(Stamp, TheEraMayTurnOver) {
  const StampTime before = to_stamp_time(std::chrono::seconds(0xffff'ffffLL));
  const StampTime after = to_stamp_time(std::chrono::seconds(0x1'0000'0001LL));
  EXPECT_EQ(stamp_difference(after, before, kStampUnsynchronised), std::chrono::seconds(2));
}

RC_GTEST_PROP(StampProperty, DifferencesAreExactToANanosecond, ()) {
  const auto any_time = [] {
    return Duration{*rc::gen::inRange<std::int64_t>(0, 4'000'000'000'000'000'000)};
  };
  const Duration a = any_time();
  const Duration b = a + Duration{*rc::gen::inRange<std::int64_t>(0, 1'000'000'000'000)};
  const Duration there = stamp_difference(to_stamp_time(b), to_stamp_time(a), kStampUnsynchronised);
  const Duration back = stamp_difference(to_stamp_time(a), to_stamp_time(b), kStampUnsynchronised);
  RC_ASSERT(std::abs((there - (b - a)).count()) <= 1);
  RC_ASSERT(std::abs((back + (b - a)).count()) <= 1);
}

RC_GTEST_PROP(StampProperty, AnyBytesAreRefusedOrComeBack, (std::vector<std::uint8_t> bytes)) {
  const ByteView view = std::as_bytes(std::span(bytes));
  std::array<std::byte, kStampBytes> out{};
  if (const auto request = parse_stamp_request(view)) {
    write_stamp_request(out, *request, 0);
    RC_ASSERT(parse_stamp_request(out) == request);
  }
  if (const auto reply = parse_stamp_reply(view)) {
    write_stamp_reply(out, *reply, {});
    RC_ASSERT(parse_stamp_reply(out) == reply);
  }
}

}  // namespace
}  // namespace interneuron::wire::stamp_test
