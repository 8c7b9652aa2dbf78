#include "core/probe/silence.h"

#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <map>
#include <random>

#include "core/probe/reflectors.h"

namespace interneuron::probe::silence_test {
namespace {

using namespace std::chrono_literals;

constexpr SessionId kProber{0x5eed0001};
constexpr LinkId kNic{4};
constexpr Duration kOneWay = 20ms;

Address address_of(std::size_t flow) {
  Address address;
  address.raw[0] = static_cast<std::byte>(flow);
  address.size = 1;
  return address;
}

// In virtual time: the test, a NAT that forgets a flow after `forgets`, and a real reflector.
class NatPath {
 public:
  explicit NatPath(Silence limit, Duration forgets = 24h)
      : test(limit, kProber, now), forgets_(forgets), used_(test.flows()) {}

  // True: the n-th packet, of both ways, is lost.
  std::function<bool(std::size_t n)> lose = [](std::size_t) { return false; };
  bool peer_lives = true;
  EchoReflector reflector{SessionId{0xcafe0002}};
  TimePoint now{100s};
  std::size_t sent = 0;
  std::size_t sent_at_once = 0;  // at most, at one instant
  SilenceTest test;

  // To the end, or for so long.
  void run(Duration at_most = 1h) {
    const TimePoint end = now + at_most;
    send();
    while (!test.done()) {
      TimePoint next = *test.next_timeout();
      if (!flying_.empty()) next = std::min(next, flying_.begin()->first);
      if (const auto t = reflector.next_timeout()) next = std::min(next, *t);
      if (next > end) {
        now = end;
        return;
      }
      now = std::max(now, next);
      arrive();
      reflect();
      send();
    }
  }

 private:
  struct Flying {
    std::size_t flow = 0;
    bool is_reply = false;
    Bytes bytes;
  };
  void fly(std::size_t flow, bool is_reply, ByteView bytes) {
    if (lose(packets_++)) return;
    flying_.emplace(now + kOneWay, Flying{flow, is_reply, Bytes(bytes.begin(), bytes.end())});
  }
  void send() {
    std::size_t count = 0;
    while (const auto sending = test.poll(now, buffer_)) {
      ++sent;
      ++count;
      used_[sending->flow] = now;  // the NAT is next to us
      fly(sending->flow, false, ByteView(buffer_).first(sending->size));
    }
    sent_at_once = std::max(sent_at_once, count);
  }
  void arrive() {
    while (!flying_.empty() && flying_.begin()->first <= now) {
      const Flying f = std::move(flying_.extract(flying_.begin()).mapped());
      if (!f.is_reply) {
        if (!peer_lives) continue;
        reflector.take(now, *wire::parse(f.bytes), {kNic, address_of(f.flow), f.bytes}, {true, {}});
      } else if (now - used_[f.flow] < forgets_) {
        used_[f.flow] = now;
        test.handle(now, f.flow, f.bytes);
      }
    }
  }
  void reflect() {
    while (const auto transmit = reflector.poll(now, buffer_)) {
      fly(static_cast<std::size_t>(transmit->to.raw[0]), true,
          ByteView(buffer_).first(transmit->size));
    }
  }

  Duration forgets_;
  std::vector<TimePoint> used_;
  std::multimap<TimePoint, Flying> flying_;
  std::size_t packets_ = 0;
  std::array<std::byte, 2000> buffer_;
};

TEST(Silence, APathThatStaysOpenSurvivesAll) {
  NatPath path(60s);
  const TimePoint start = path.now;
  EXPECT_GE(path.test.ends_at(), start + 60s);
  path.run();
  const SilenceResult result = path.test.result();
  EXPECT_TRUE(path.test.done());
  EXPECT_TRUE(result.answered);
  EXPECT_FALSE(result.refused);
  EXPECT_EQ(result.survived, 60s);
  EXPECT_FALSE(result.closed);
  EXPECT_EQ(path.test.flows(), 12U);
  EXPECT_EQ(path.sent, 36U) << "three packets per flow, none of them in a silence";
  EXPECT_LE(path.sent_at_once, 6U);
  EXPECT_LE(path.now - start, 66s);
  EXPECT_LE(path.test.ends_at(), path.now);
}

TEST(Silence, TheTimeoutOfANatIsBetweenTwoSilences) {
  struct Case {
    Duration forgets;
    Silence limit, survived, closed;
  };
  for (const Case& c : {
           Case{3s, 60s, 0s, 5s},
           Case{7s, 15s, 5s, 10s},
           Case{10s, 60s, 5s, 10s},
           Case{11s, 60s, 10s, 15s},
           Case{29s, 60s, 20s, 30s},
           Case{40s, 45s, 30s, 45s},
           Case{180s, 240s, 120s, 240s},
       }) {
    NatPath path(c.limit, c.forgets);
    path.run();
    const SilenceResult result = path.test.result();
    EXPECT_TRUE(result.answered);
    EXPECT_EQ(result.survived.value_or(0s), c.survived) << to_ms(c.forgets) << " ms";
    EXPECT_EQ(result.closed, c.closed) << to_ms(c.forgets) << " ms";
  }
}

TEST(Silence, TheLimitIsAlwaysTried) {
  for (const Silence limit : {5s, 6s, 10s, 59s, 239s, 240s}) {
    NatPath path(limit);
    path.run();
    EXPECT_EQ(path.test.result().survived, limit);
    EXPECT_LE(path.test.flows(), SilenceTest::kFlowsAtMost);
  }
}

TEST(Silence, OneLostPacketChangesNothing) {
  // 8 flows, 3 packets each, both ways.
  for (std::size_t lost = 0; lost < 48; ++lost) {
    NatPath path(20s, 12s);
    path.lose = [lost](std::size_t n) { return n == lost; };
    path.run();
    EXPECT_EQ(path.test.result().survived, 10s) << lost;
    EXPECT_EQ(path.test.result().closed, 15s) << lost;
  }
}

TEST(Silence, LossNeverMakesATimeoutLonger) {
  std::mt19937_64 random(7);
  for (int i = 0; i < 200; ++i) {
    NatPath path(30s, 12s);
    path.lose = [&random](std::size_t) { return random() % 10 == 0; };
    path.run();
    const SilenceResult result = path.test.result();
    EXPECT_TRUE(result.answered);
    EXPECT_LE(result.survived.value_or(0s), 10s);
  }
}

TEST(Silence, ALongerSilenceThatIsSurvivedSpeaksForTheShorterOnes) {
  NatPath path(10s);
  path.run(4s);  // both flows are silent
  path.lose = [&](std::size_t) { return path.now < TimePoint{109s}; };
  path.run();
  EXPECT_EQ(path.test.result().survived, 10s);
  EXPECT_FALSE(path.test.result().closed);
}

TEST(Silence, APeerWithoutRoomIsNoTimeout) {
  NatPath path(10s, 7s);
  for (std::size_t i = 0; i < EchoReflector::kMaxDelayed; ++i) {
    wire::Echo echo;
    echo.delay = 255;
    Bytes bytes(200);
    bytes.resize(wire::write_echo(
        bytes, {wire::PacketType::kEcho, LinkId{1}, wire::kClearEpoch, SessionId{1}, i + 1}, echo,
        0));
    path.reflector.take(path.now, *wire::parse(bytes),
                        {kNic, address_of(90 + i / EchoReflector::kMaxDelayedOfHost), bytes},
                        {true, {}});
  }
  path.run();
  const SilenceResult result = path.test.result();
  EXPECT_TRUE(result.answered);
  EXPECT_TRUE(result.refused);
  EXPECT_FALSE(result.survived);
  EXPECT_FALSE(result.closed);
}

TEST(Silence, ADeadPeerIsSeenSoon) {
  NatPath path(240s);
  const TimePoint start = path.now;
  path.peer_lives = false;
  path.run();
  const SilenceResult result = path.test.result();
  EXPECT_TRUE(path.test.done());
  EXPECT_FALSE(result.answered);
  EXPECT_FALSE(result.survived);
  EXPECT_FALSE(result.closed);
  EXPECT_LE(path.now - start, 10s);
}

TEST(Silence, WhatIsKnownBeforeTheEndIsTold) {
  NatPath path(60s, 12s);
  path.run(11s);
  EXPECT_FALSE(path.test.done());
  EXPECT_EQ(path.test.result().survived, 5s);
  EXPECT_FALSE(path.test.result().closed);
  path.run(10s);
  EXPECT_EQ(path.test.result().survived, 10s);
  EXPECT_EQ(path.test.result().closed, 15s);
  EXPECT_GT(path.test.ends_at(), path.now + 40s);
}

TEST(Silence, WhatAnswersNothingOfOursIsIgnored) {
  SilenceTest test(5s, kProber, TimePoint{100s});
  std::array<std::byte, 2000> buffer;
  ASSERT_TRUE(test.poll(TimePoint{100s}, buffer));
  wire::Echo echo;
  echo.is_reply = true;
  for (const std::uint32_t sequence : {0U, 1U, UINT32_MAX}) {
    echo.reply.request_sequence = sequence;  // and another time of sending
    Bytes bytes(200);
    bytes.resize(wire::write_echo(
        bytes, {wire::PacketType::kEcho, LinkId{0}, wire::kClearEpoch, SessionId{1}, 1}, echo, 0));
    test.handle(TimePoint{101s}, 0, bytes);
    test.handle(TimePoint{101s}, 0, ByteView(bytes).first(20));
  }
  EXPECT_FALSE(test.result().answered);
}

}  // namespace
}  // namespace interneuron::probe::silence_test
