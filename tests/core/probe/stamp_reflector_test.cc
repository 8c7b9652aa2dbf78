#include "core/probe/reflectors.h"

#include <gtest/gtest.h>

#include <array>
#include <random>

#include "core/wire/packet.h"

namespace interneuron::probe::stamp_reflector_test {
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

// The bytes of a sockaddr_in.
Address ipv4(std::uint8_t host, std::uint16_t port) {
  Address a{.size = 16};
  a.raw[2] = static_cast<std::byte>(port >> 8);
  a.raw[3] = static_cast<std::byte>(port & 0xff);
  a.raw[4] = std::byte{10};
  a.raw[7] = static_cast<std::byte>(host);
  return a;
}

// How many packets pass between two reflectors at these ports after one request that was forged in
// the name of the second; stops at 100.
int packets_between(std::uint16_t port1, std::uint16_t port2, bool stateful) {
  StampReflector first(stateful, port1);
  StampReflector second(stateful, port2);
  Bytes packet(100);
  wire::write_stamp_request(packet, {7, 99, wire::kStampUnsynchronised}, packet.size());
  TimePoint now{5s};
  for (int sent = 1; sent < 100; ++sent) {
    const bool at_first = sent % 2 == 1;
    now += 1ms;
    Bytes answer(packet.size());
    const std::size_t size =
        (at_first ? first : second)
            .answer({LinkId{0}, at_first ? ipv4(2, port2) : ipv4(1, port1), packet, 64, now}, now,
                    1000h, answer);
    if (size == 0) return sent;
    packet = answer;
  }
  return 100;
}

TEST(TwoReflectors, DoNotAnswerEachOther) {
  for (const bool stateful : {true, false}) {
    EXPECT_LE(packets_between(862, 862, stateful), 2);
    EXPECT_LE(packets_between(9000, 9000, stateful), 2);
    EXPECT_LE(packets_between(9000, 862, stateful), 2);
    EXPECT_LE(packets_between(862, 9000, stateful), 2);
    EXPECT_LE(packets_between(9000, 9001, stateful), 2);
  }
}

TEST_F(Answering, NeitherAReplyNorAnEchoReplyIsAnswered) {
  Bytes reply(100);
  wire::StampReply stamp = wire::stamp_reply_to({3, 99, wire::kStampUnsynchronised}, 64);
  stamp.received = wire::to_stamp_time(1000h);
  wire::write_stamp_reply(reply, stamp, Bytes(56));
  EXPECT_EQ(reflector_.answer({LinkId{0}, ipv4(1, 40000), reply, 64, now_}, now_, 0s, out_), 0U);

  wire::Echo echo;
  echo.is_reply = true;
  echo.reply = stamp;
  Bytes bytes(200);
  bytes.resize(wire::write_echo(
      bytes, {wire::PacketType::kEcho, LinkId{1}, wire::kClearEpoch, SessionId{5}, 1}, echo, 200));
  EXPECT_EQ(reflector_.answer({LinkId{0}, ipv4(1, 40000), bytes, 64, now_}, now_, 0s, out_), 0U);
}

TEST_F(Answering, RequestsThatArePaddedAtRandomAreAnswered) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 1000; ++i) {
    Bytes request(100);
    wire::write_stamp_request(request, {1, 99, wire::kStampUnsynchronised}, request.size());
    for (std::size_t at = 14; at < request.size(); ++at) {
      request[at] = static_cast<std::byte>(random());
    }
    EXPECT_EQ(reflector_.answer({LinkId{0}, ipv4(1, 40000), request, 64, now_}, now_, 0s, out_),
              request.size());
  }
}

TEST_F(Answering, OneSourceGetsNoMoreThanItsShareAndOthersGetTheirs) {
  int answers = 0;
  for (int i = 0; i < 2 * kAnswerBurst; ++i) answers += ask(0, 1) ? 1 : 0;
  EXPECT_EQ(answers, kAnswerBurst);
  EXPECT_TRUE(ask(0, 2));
}

}  // namespace
}  // namespace interneuron::probe::stamp_reflector_test
