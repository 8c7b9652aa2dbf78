#include "core/probe/stamp_reflector.h"

#include <gtest/gtest.h>

#include <array>

namespace interneuron::probe {
namespace {

using namespace std::chrono_literals;

Address from(int who) {
  Address a;
  a.raw[0] = static_cast<std::byte>(who & 0xff);
  a.raw[1] = static_cast<std::byte>(who >> 8);
  a.size = 2;
  return a;
}

class Answering : public testing::Test {
 protected:
  std::optional<wire::StampReply> ask(std::uint32_t sequence, int who = 1, LinkId nic = LinkId{0},
                                      std::size_t size = 100) {
    Bytes request(size);
    wire::write_stamp_request(request, {sequence, 99, wire::kStampUnsynchronised}, size);
    request.back() = std::byte{0x5a};
    size_ = reflector_.answer({nic, from(who), request, 63, now_}, now_ + 20us, 1000h, out_);
    last_ = size_ > 0 ? out_[size_ - 1] : std::byte{};
    return wire::parse_stamp_reply(ByteView(out_).first(size_));
  }
  StampReflector reflector_{true};
  std::array<std::byte, 2000> out_{};
  std::size_t size_ = 0;
  std::byte last_{};
  TimePoint now_{5s};
};

TEST_F(Answering, AsTheRfcSays) {
  const auto reply = ask(7);
  ASSERT_TRUE(reply);
  EXPECT_EQ(size_, 100U);
  EXPECT_EQ(last_, std::byte{0x5a}) << "what is behind the base comes back as it was";
  EXPECT_EQ(reply->sequence, 0U);
  EXPECT_EQ(reply->request_sequence, 7U);
  EXPECT_EQ(reply->request_sent, 99U);
  EXPECT_EQ(reply->request_ttl, 63);
  EXPECT_EQ(reply->received, wire::to_stamp_time(1000h + 5s));
  EXPECT_EQ(reply->sent, wire::to_stamp_time(1000h + 5s + 20us));
}

TEST_F(Answering, EachSessionIsCountedByItself) {
  EXPECT_EQ(ask(0)->sequence, 0U);
  EXPECT_EQ(ask(5)->sequence, 1U);
  EXPECT_EQ(ask(6, 2)->sequence, 0U);
  EXPECT_EQ(ask(7, 1, LinkId{1})->sequence, 0U);
  EXPECT_EQ(ask(8)->sequence, 2U);
}

TEST_F(Answering, AfterALongSilenceItBeginsAnew) {
  ask(0);
  now_ += StampReflector::kSessionSilence;
  EXPECT_EQ(ask(1)->sequence, 0U);
}

TEST_F(Answering, StatelessItRepeatsTheNumber) {
  reflector_ = StampReflector(false);
  EXPECT_EQ(ask(7)->sequence, 7U);
  EXPECT_EQ(ask(3)->sequence, 3U);
}

TEST_F(Answering, WhatIsNoTestPacketIsNotAnswered) {
  const Bytes garbage(100);
  EXPECT_EQ(reflector_.answer({LinkId{0}, from(1), garbage, 0, now_}, now_, 0s, out_), 0U);
  const Bytes tiny(43, std::byte{1});
  EXPECT_EQ(reflector_.answer({LinkId{0}, from(1), tiny, 0, now_}, now_, 0s, out_), 0U);
}

TEST_F(Answering, ManySessionsPushOutTheOldest) {
  for (int who = 0; who <= static_cast<int>(StampReflector::kMaxSessions); ++who) {
    now_ += 1ms;
    ask(0, who);
  }
  EXPECT_EQ(ask(1, 1)->sequence, 1U);
  EXPECT_EQ(ask(1, 0)->sequence, 0U);
}

}  // namespace
}  // namespace interneuron::probe
