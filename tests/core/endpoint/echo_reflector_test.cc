// Echoes are answered once, with their own size, over the path they came by.
#include "core/probe/reflectors.h"

#include "core/wire/packet.h"
#include "tests/core/endpoint/pipe.h"

namespace interneuron::echo_reflector_test {
namespace {

using probe::EchoReflector;

constexpr SessionId kSelf{0xcafe0002};
constexpr LinkId kNic{4};

struct Question {
  std::uint32_t sequence = 0;
  std::uint16_t train = 0;
  std::uint16_t index = 0;
  std::uint16_t count = 0;
  bool hold = false;
  std::size_t size = 100;
  std::uint8_t link = 1;
  std::uint32_t session = 0x5eed0001;
  std::size_t from = 9;
  std::uint8_t delay = 0;
};

Bytes bytes_of(const Question& q, const wire::Token& token = {}) {
  wire::Echo echo;
  echo.token = token;
  echo.train = q.train;
  echo.index = q.index;
  echo.count = q.count;
  echo.hold = q.hold;
  echo.delay = q.delay;
  echo.request.sequence = q.sequence;
  echo.request.sent = wire::to_stamp_time(std::chrono::seconds(5));
  Bytes out(2000);
  out.resize(wire::write_echo(out,
                              {wire::PacketType::kEcho, LinkId{q.link}, wire::kClearEpoch,
                               SessionId{q.session}, q.sequence + 1U},
                              echo, q.size));
  return out;
}

class Reflecting : public testing::Test {
 protected:
  EchoReflector::Asker asker_{true, {std::byte{7}}};
  bool ask(const Question& q) {
    const Bytes bytes = bytes_of(q);
    return reflector_.take(now_, *wire::parse(bytes), {kNic, address_of(q.from), bytes}, asker_);
  }
  struct Answer {
    Transmit transmit;
    wire::PacketHeader header;
    wire::Echo echo;
  };
  std::vector<Answer> answers() {
    std::vector<Answer> out;
    std::array<std::byte, 2000> buffer;
    while (const auto transmit = reflector_.poll(now_, buffer)) {
      const auto packet = wire::parse(ByteView(buffer).first(transmit->size));
      if (!packet) {
        ADD_FAILURE() << "malformed";
        break;
      }
      out.push_back({*transmit, packet->header, packet->echo});
    }
    return out;
  }

  EchoReflector reflector_{kSelf};
  TimePoint now_{10s};
};

TEST_F(Reflecting, AnswersAtOnceTheSameSizeToWhereItCameFrom) {
  ASSERT_TRUE(ask({.sequence = 7, .size = 333}));
  now_ += 3us;
  const auto got = answers();
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(got[0].transmit.size, 333U);
  EXPECT_EQ(got[0].transmit.link, kNic);
  EXPECT_EQ(got[0].transmit.to, address_of(9));
  EXPECT_EQ(got[0].header.session, kSelf);
  EXPECT_EQ(got[0].header.link, LinkId{1});
  const wire::StampReply& reply = got[0].echo.reply;
  EXPECT_TRUE(got[0].echo.is_reply);
  EXPECT_EQ(reply.sequence, 0U);
  EXPECT_EQ(reply.request_sequence, 7U);
  EXPECT_EQ(reply.request_sent, wire::to_stamp_time(std::chrono::seconds(5)));
  EXPECT_EQ(reply.received, wire::to_stamp_time(10s));
  EXPECT_EQ(wire::stamp_difference(reply.sent, reply.received, reply.error_estimate), 3us);
  EXPECT_FALSE(reflector_.next_timeout());
}

TEST_F(Reflecting, WhatComesFromThePortOfStampIsNotAnswered) {
  const Bytes bytes = bytes_of({});
  Address stamp{.size = 16};
  stamp.raw[2] = std::byte{862 >> 8};
  stamp.raw[3] = std::byte{862 & 0xff};
  EXPECT_FALSE(reflector_.take(now_, *wire::parse(bytes), {kNic, stamp, bytes}, {}));
  stamp.raw[3] = std::byte{863 & 0xff};
  EXPECT_TRUE(reflector_.take(now_, *wire::parse(bytes), {kNic, stamp, bytes}, {}));
}

TEST_F(Reflecting, OneSourceGetsNoMoreThanItsShareAndOthersGetTheirs) {
  std::size_t got = 0;
  for (int i = 0; i < 2 * probe::kAnswerBurst; ++i) {
    ask({.session = static_cast<std::uint32_t>(i + 1)});
    got += answers().size();
  }
  EXPECT_EQ(got, std::size_t{probe::kAnswerBurst});
  EXPECT_TRUE(ask({.from = 8}));
  now_ += 10 * probe::kAnswerInterval;
  for (int i = 0; i < 100; ++i) ask({});
  EXPECT_EQ(answers().size(), 11U);
}

TEST_F(Reflecting, CountsTheRequestsOfEachPathByItself) {
  for (const std::uint32_t sequence : {0U, 3U, 4U}) ask({.sequence = sequence});
  ask({.sequence = 0, .link = 2});
  ask({.sequence = 0, .session = 0x5eed0002});
  ask({.sequence = 0, .from = 8});
  std::vector<std::uint32_t> counted;
  for (const Answer& a : answers()) counted.push_back(a.echo.reply.sequence);
  EXPECT_EQ(counted, (std::vector<std::uint32_t>{0, 1, 2, 0, 0, 0}));
}

TEST_F(Reflecting, AHeldTrainLeavesBackToBackWhenItsLastRequestCame) {
  for (std::uint16_t i = 0; i < 4; ++i) {
    ASSERT_TRUE(ask({.sequence = i, .train = 1, .index = i, .count = 5, .hold = true}));
    EXPECT_TRUE(answers().empty());
    now_ += 10ms;
  }
  ASSERT_TRUE(ask({.sequence = 4, .train = 1, .index = 4, .count = 5, .hold = true}));
  const auto got = answers();
  ASSERT_EQ(got.size(), 5U);
  for (std::size_t i = 0; i < got.size(); ++i) {
    EXPECT_EQ(got[i].echo.index, i);
    EXPECT_EQ(got[i].echo.reply.received, wire::to_stamp_time(10s + i * 10ms));
    EXPECT_EQ(got[i].echo.reply.sent, wire::to_stamp_time(10s + 40ms));
  }
}

TEST_F(Reflecting, ATrainWhoseLastRequestIsLostLeavesAfterAWhile) {
  ask({.sequence = 0, .train = 1, .index = 0, .count = 5, .hold = true});
  now_ += 30ms;
  ask({.sequence = 1, .train = 1, .index = 1, .count = 5, .hold = true});
  ASSERT_EQ(reflector_.next_timeout(), now_ + EchoReflector::kHold);
  now_ += EchoReflector::kHold - 1ns;
  EXPECT_TRUE(answers().empty());
  now_ += 1ns;
  EXPECT_EQ(answers().size(), 2U);
  EXPECT_FALSE(reflector_.next_timeout());
}

TEST_F(Reflecting, ASlowTrainIsHeldForABoundedTime) {
  const TimePoint began = now_;
  std::size_t answered = 0;
  for (std::uint16_t i = 0; i < 10; ++i) {
    ask({.sequence = i, .train = 1, .index = i, .count = 11, .hold = true});
    now_ += 90ms;
    answered = answers().size();
    if (answered > 0) break;
  }
  EXPECT_GT(answered, 0U);
  EXPECT_LT(now_ - began, EchoReflector::kHoldAtMost + 90ms);
}

TEST_F(Reflecting, TheNextTrainEndsTheOneBefore) {
  ask({.sequence = 0, .train = 1, .index = 0, .count = 5, .hold = true});
  ask({.sequence = 5, .train = 2, .index = 0, .count = 5, .hold = true});
  const auto got = answers();
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(got[0].echo.train, 1);
}

TEST_F(Reflecting, WithoutRoomToHoldATrainIsAnsweredAtOnce) {
  for (std::uint8_t path = 0; path <= EchoReflector::kMaxHeldTrains; ++path) {
    const std::size_t host = path / EchoReflector::kMaxHeldTrainsOfHost;
    ask({.train = 1, .index = 0, .count = 5, .hold = true, .link = path, .from = host});
  }
  const auto got = answers();
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(got[0].header.link, LinkId{EchoReflector::kMaxHeldTrains});
}

TEST_F(Reflecting, ALaterReplyLeavesWhenItIsWanted) {
  ASSERT_TRUE(ask({.sequence = 1, .delay = 20}));
  now_ += 1s;
  ASSERT_TRUE(ask({.sequence = 2, .delay = 5}));
  ASSERT_TRUE(ask({.sequence = 3}));
  const auto at_once = answers();
  ASSERT_EQ(at_once.size(), 1U);
  EXPECT_EQ(at_once[0].echo.reply.request_sequence, 3U);
  EXPECT_EQ(reflector_.waiting(), 2U);
  for (const auto& [sequence, at] : {std::pair{2U, TimePoint{16s}}, {1U, TimePoint{30s}}}) {
    ASSERT_EQ(reflector_.next_timeout(), at);
    now_ = at - 1ns;
    EXPECT_TRUE(answers().empty());
    now_ = at;
    const auto got = answers();
    ASSERT_EQ(got.size(), 1U);
    const wire::StampReply& reply = got[0].echo.reply;
    EXPECT_EQ(reply.request_sequence, sequence);
    EXPECT_EQ(reply.sent, wire::to_stamp_time(at.time_since_epoch()));
    EXPECT_EQ(wire::stamp_difference(reply.sent, reply.received, reply.error_estimate),
              std::chrono::seconds(got[0].echo.delay));
  }
  EXPECT_FALSE(reflector_.next_timeout());
  EXPECT_EQ(reflector_.waiting(), 0U);
}

TEST_F(Reflecting, WithoutRoomALaterReplyLeavesAtOnce) {
  for (std::uint32_t i = 0; i < EchoReflector::kMaxDelayed; ++i) {
    ASSERT_TRUE(
        ask({.sequence = i, .from = 20 + i / EchoReflector::kMaxDelayedOfHost, .delay = 255}));
  }
  EXPECT_TRUE(answers().empty());
  ASSERT_TRUE(ask({.sequence = 99, .delay = 255}));
  const auto got = answers();
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(got[0].echo.reply.request_sequence, 99U);
  EXPECT_EQ(got[0].echo.delay, 255);
}

// Whether it wants them later or trains of them together.
TEST_F(Reflecting, AHostThatAsksForManyLaterRepliesLeavesRoomForOthers) {
  for (std::uint32_t i = 0; i < EchoReflector::kMaxDelayed; ++i) {
    ask({.sequence = i, .from = 20, .delay = 255});
  }
  EXPECT_EQ(answers().size(), EchoReflector::kMaxDelayed - EchoReflector::kMaxDelayedOfHost);
  ask({.sequence = 99, .from = 21, .delay = 255});
  EXPECT_TRUE(answers().empty());
  for (std::uint8_t path = 0; path < EchoReflector::kMaxHeldTrains; ++path) {
    ask({.train = 1, .index = 0, .count = 5, .hold = true, .link = path, .from = 20});
  }
  EXPECT_EQ(answers().size(), EchoReflector::kMaxHeldTrains - EchoReflector::kMaxHeldTrainsOfHost);
  ask({.train = 1, .index = 0, .count = 5, .hold = true, .from = 21});
  EXPECT_TRUE(answers().empty());
}

TEST_F(Reflecting, LaterRepliesTakeNoRoomOfOthers) {
  for (std::uint32_t i = 0; i < EchoReflector::kMaxDelayed; ++i) {
    ask({.sequence = i, .from = 20 + i / EchoReflector::kMaxDelayedOfHost, .delay = 1});
  }
  std::size_t taken = 0;
  for (std::uint32_t i = 0; i < 5000; ++i) taken += ask({.sequence = i}) ? 1 : 0;
  EXPECT_EQ(taken, EchoReflector::kMaxWaiting);
  EXPECT_EQ(reflector_.waiting(), EchoReflector::kMaxWaiting + EchoReflector::kMaxDelayed);
}

TEST_F(Reflecting, MemoryIsBounded) {
  constexpr std::size_t kHosts = 64;
  std::size_t taken = 0;
  for (std::uint32_t i = 0; i < 5000; ++i) {
    // From many hosts, each within its share.
    const Question question{
        .sequence = i, .link = static_cast<std::uint8_t>(i), .session = 1 + i, .from = i % kHosts};
    taken += ask(question) ? 1 : 0;
  }
  EXPECT_EQ(taken, EchoReflector::kMaxWaiting);
  EXPECT_EQ(answers().size(), EchoReflector::kMaxWaiting);
  // What was dropped did arrive: the numbers say so.
  ask({.sequence = 1,
       .link = static_cast<std::uint8_t>(4999),
       .session = 5000,
       .from = 4999 % kHosts});
  EXPECT_EQ(answers().at(0).echo.reply.sequence, 1U);
}

TEST_F(Reflecting, RepliesAreNotAnswered) {
  wire::Echo echo;
  echo.is_reply = true;
  Bytes bytes(200);
  bytes.resize(wire::write_echo(
      bytes, {wire::PacketType::kEcho, LinkId{1}, wire::kClearEpoch, SessionId{1}, 1}, echo, 0));
  EXPECT_FALSE(reflector_.take(now_, *wire::parse(bytes), {kNic, address_of(9), bytes}, {}));
  EXPECT_TRUE(answers().empty());
}

TEST_F(Reflecting, ALinkThatIsGoneTakesItsRepliesWithIt) {
  ask({.sequence = 0});
  ask({.sequence = 1, .train = 1, .index = 0, .count = 5, .hold = true});
  ask({.sequence = 2, .delay = 5});
  reflector_.remove_link(kNic);
  EXPECT_TRUE(answers().empty());
  EXPECT_FALSE(reflector_.next_timeout());
}

// --- as part of an endpoint

std::size_t answers_of(Endpoint& endpoint, TimePoint now, const Bytes& bytes) {
  endpoint.handle_datagram(now, {kFast, address_of(9), bytes});
  std::array<std::byte, kMaxDatagramBytes> buffer;
  std::size_t count = 0;
  while (endpoint.poll_transmit(now, buffer)) ++count;
  return count;
}

// What an echo that is answered at once brings back.
wire::Token token_from(Endpoint& endpoint, TimePoint now, const Question& question) {
  const Bytes bytes = bytes_of(question);
  endpoint.handle_datagram(now, {kFast, address_of(9), bytes});
  std::array<std::byte, kMaxDatagramBytes> buffer;
  const auto transmit = endpoint.poll_transmit(now, buffer);
  const auto reply = wire::parse(ByteView(buffer).first(transmit ? transmit->size : 0));
  return reply ? reply->echo.token : wire::Token{};
}

TEST(EchoOfAnEndpoint, IsAnsweredByWhoServesAnybodyAndMakesNoPeer) {
  const TimePoint now{1s};
  for (const bool serves : {true, false}) {
    Endpoint endpoint(options_of(0xcafe0002, {}, serves), now);
    endpoint.add_link(now, kFast, {"nic", 1500});
    EXPECT_EQ(answers_of(endpoint, now, bytes_of({})), serves ? 1U : 0U);
    EXPECT_TRUE(endpoint.peers().empty());
    EXPECT_FALSE(endpoint.poll_event());
    const LinkCounters counters = endpoint.link_counters(kFast);
    EXPECT_EQ(counters.received_packets, serves ? 1U : 0U);
    EXPECT_EQ(counters.refused_packets, serves ? 0U : 1U);
    EXPECT_EQ(counters.sent_packets, serves ? 1U : 0U);
  }
}

TEST(EchoOfAnEndpoint, ALaterReplyWakesItUp) {
  const TimePoint now{1s};
  Endpoint endpoint(options_of(0xcafe0002), now);
  endpoint.add_link(now, kFast, {"nic", 1500});
  const Question question{.delay = 3};
  EXPECT_EQ(answers_of(endpoint, now, bytes_of(question, token_from(endpoint, now, {}))), 0U);
  ASSERT_EQ(endpoint.next_timeout(), now + 3s);
  endpoint.handle_timeout(now + 3s);
  std::array<std::byte, kMaxDatagramBytes> buffer;
  EXPECT_TRUE(endpoint.poll_transmit(now + 3s, buffer));
}

TEST(EchoOfAnEndpoint, AHeldTrainWakesItUp) {
  const TimePoint now{1s};
  Endpoint endpoint(options_of(0xcafe0002), now);
  endpoint.add_link(now, kFast, {"nic", 1500});
  const Question question{.train = 1, .index = 0, .count = 5, .hold = true};
  EXPECT_EQ(answers_of(endpoint, now, bytes_of(question, token_from(endpoint, now, {}))), 0U);
  ASSERT_EQ(endpoint.next_timeout(), now + EchoReflector::kHold);
  endpoint.handle_timeout(now + EchoReflector::kHold);
  std::array<std::byte, kMaxDatagramBytes> buffer;
  EXPECT_TRUE(endpoint.poll_transmit(now + EchoReflector::kHold, buffer));
}

// Who does not prove its address is answered at once, and told how to prove it.
TEST_F(Reflecting, HoldsAndDelaysForNobodyWhoseAddressIsNotProved) {
  asker_ = {false, {std::byte{9}}};
  Question held{.train = 1, .count = 3, .hold = true};
  Question delayed{.delay = 5};
  for (const Question& q : {held, delayed}) {
    EXPECT_TRUE(ask(q));
    const auto out = answers();
    ASSERT_EQ(out.size(), 1U);
    EXPECT_EQ(out.front().echo.token, asker_.token);
    EXPECT_FALSE(reflector_.next_timeout());
  }
}

}  // namespace
}  // namespace interneuron::echo_reflector_test
