// Who has a place where there are more than places: nobody can keep others out.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/wire/round_header.h"
#include "join.h"

namespace interneuron::join_test {
namespace {

using testing::IsEmpty;

// 50,000 packets a second from forged addresses, and 1,000 a second from addresses that answer
// challenges and then say nothing: who is there stays, and who comes joins.
TEST(Join, AFloodKeepsNobodyOut) {
  Unit unit(64);
  std::vector<SessionId> served;
  for (std::uint8_t i = 0; i < 3; ++i) {
    served.push_back(SessionId{100U + i});
    join(unit, served.back(), ipv4(1, i, 1));
  }
  ASSERT_EQ(unit.ready.size(), 3U);
  constexpr SessionId kNew{200};
  const Address from = ipv4(2, 0, 1);
  std::uint32_t session = 1'000'000;
  std::optional<wire::Token> owed;
  std::uint64_t number = 10;
  bool ready = false;
  int owned = 0;
  const TimePoint begin = unit.now;
  for (int step = 0; step < 20'000 && !ready; ++step) {  // of 100 µs
    unit.now += 100us;
    std::vector<Sent> sent;
    for (int i = 0; i < 5; ++i) {
      const auto x = static_cast<std::uint16_t>(session * 2654435761U >> 16U);
      const Address forged = ipv4(static_cast<std::uint8_t>(100 + x % 100),
                                  static_cast<std::uint8_t>(x >> 8U), static_cast<std::uint8_t>(x));
      for (Sent& s : unit.feed(forged, hello(SessionId{session++}))) sent.push_back(std::move(s));
    }
    if (step % 10 == 0) {
      const Address own = ipv4(50, static_cast<std::uint8_t>(owned % 4),
                               static_cast<std::uint8_t>(owned), static_cast<std::uint16_t>(owned));
      ++owned;
      const SessionId theirs{session++};
      if (const auto c = challenge_in(unit.feed(own, hello(theirs)), own)) {
        unit.feed(own, token_packet(theirs, 2, c->challenge.token));
      }
    }
    if (step % 600 == 0) {
      for (const SessionId s : served) {
        unit.feed(ipv4(1, static_cast<std::uint8_t>(s.value - 100), 1), hello(s, ++number, kRoad));
      }
      const auto c = challenge_in(unit.feed(from, hello(kNew, ++number)), from);
      if (c) owed = c->challenge.token;
    }
    // 60 ms until the challenge is answered, and 60 ms until the unit's first feedback is.
    if (step % 600 == 599 && owed) {
      unit.feed(from, token_packet(kNew, ++number, *owed));
      unit.feed(from, hello(kNew, ++number, kRoad));
      ready = unit.ready.size() == 4;
    }
  }
  EXPECT_TRUE(ready);
  EXPECT_LE(unit.now - begin, 1s);
  EXPECT_THAT(unit.lost, IsEmpty());
  EXPECT_LE(unit.peers(), 64U);
}

TEST(Join, WhoTakesManyPlacesMakesRoomForWhoeverTakesFew) {
  Unit unit(4);
  join(unit, SessionId{1}, ipv4(1, 0, 1));
  for (std::uint8_t i = 1; i <= 3; ++i) join(unit, SessionId{10U + i}, ipv4(2, 0, 1, i));
  ASSERT_EQ(unit.ready.size(), 4U);
  // The same host again: it has as many as it can.
  const Address again = ipv4(2, 0, 1, 9);
  const auto c = challenge_in(unit.feed(again, hello(SessionId{20})), again);
  ASSERT_TRUE(c);
  unit.feed(again, token_packet(SessionId{20}, 2, c->challenge.token));
  EXPECT_THAT(unit.lost, IsEmpty());
  EXPECT_EQ(unit.peers(), 4U);
  // Another network: the youngest of the host with three makes room.
  join(unit, SessionId{30}, ipv4(3, 0, 1));
  EXPECT_EQ(unit.ready.size(), 5U);
  EXPECT_THAT(unit.lost, testing::ElementsAre(unit.ready[3]));
  // Whoever never shows that it has heard us goes before anybody else does.
  join(unit, SessionId{31}, ipv4(4, 0, 1), false);
  EXPECT_EQ(unit.lost.size(), 2U);
  join(unit, SessionId{32}, ipv4(5, 0, 1));
  EXPECT_EQ(unit.lost.size(), 2U);
  EXPECT_EQ(unit.ready.size(), 6U);
}

// A host that holds all places and comes with one new session after the other, each of which has
// its token already, while a vehicle needs a round trip to show that it has heard us.
TEST(Join, AHostThatComesAgainAndAgainKeepsNobodyFromShowingThatItHears) {
  Unit unit(4);
  const auto own = [](std::uint16_t port) { return ipv4(2, 0, 1, port); };
  for (std::uint16_t i = 1; i <= 4; ++i) join(unit, SessionId{10U + i}, own(i));
  std::vector<Bytes> prepared;
  for (std::uint16_t i = 0; i < 30; ++i) {
    const auto c = challenge_in(unit.feed(own(100 + i), hello(SessionId{100U + i})), own(100 + i));
    ASSERT_TRUE(c);
    prepared.push_back(token_packet(SessionId{100U + i}, 2, c->challenge.token));
  }
  const Address vehicle = ipv4(3, 0, 1);
  join(unit, SessionId{1}, vehicle, false);
  for (std::uint16_t i = 0; i < 30; ++i) {
    unit.sleep(10ms);
    unit.feed(own(100 + i), prepared[i]);
  }
  unit.feed(vehicle, hello(SessionId{1}, 3, kRoad));
  EXPECT_EQ(unit.ready.size(), 5U);
}

// Vehicles of one operator share its network; a host elsewhere that has as many places as each of
// them or more drives none of them out.
TEST(Join, AHostElsewhereTakesNoMorePlacesThanOthersHave) {
  Unit unit(8);
  for (std::uint8_t i = 1; i <= 8; ++i) join(unit, SessionId{i}, ipv4(1, 0, i));
  ASSERT_EQ(unit.ready.size(), 8U);
  for (std::uint16_t i = 1; i <= 20; ++i) {
    const Address from = ipv4(2, 0, 1, i);
    const auto c = challenge_in(unit.feed(from, hello(SessionId{100U + i})), from);
    ASSERT_TRUE(c);
    unit.feed(from, token_packet(SessionId{100U + i}, 2, c->challenge.token));
    unit.feed(from, hello(SessionId{100U + i}, 3, kRoad));
  }
  EXPECT_LE(unit.lost.size(), 2U);
}

// An application keeps something for every peer that it was given a message of.
TEST(Join, WhoHasSentAMessageAndNeverShownThatItHearsIsReportedLost) {
  Unit unit(1);
  join(unit, SessionId{1}, ipv4(1, 0, 1), false);
  wire::RoundHeader header;
  header.round = {SessionId{1}, PipelineId{0}, RoundId{1}};
  header.stage = 1;
  header.stages = 3;
  header.communication = 0b101;
  header.deadline_us = 130'000;
  header.policy = wire::policy_id("down_sampling");
  header.t0 = PeerTime{unit.now.time_since_epoch()};
  Bytes message(wire::kRoundHeaderBytes + 20);
  wire::write_round_header(std::span(message).first<wire::kRoundHeaderBytes>(), header);
  const auto size = static_cast<std::uint32_t>(message.size());
  Bytes out(kMaxDatagramBytes);
  out.resize(wire::write_data(
      out, header_of(wire::PacketType::kData, SessionId{1}, 3),
      {MessageId{1}, 0, static_cast<std::uint16_t>(size), size, header.deadline_us}, message));
  unit.feed(ipv4(1, 0, 1), out);
  EXPECT_EQ(unit.delivered, 1);
  EXPECT_THAT(unit.ready, IsEmpty());
  const auto peer = unit.endpoint.peers();
  unit.sleep(70s);
  EXPECT_EQ(unit.lost, peer);
}

TEST(Join, WhoWasSilentForLongMakesRoom) {
  Unit unit(2);
  join(unit, SessionId{1}, ipv4(1, 0, 1));
  unit.sleep(10s);
  join(unit, SessionId{2}, ipv4(2, 0, 1));
  const Address from = ipv4(3, 0, 1);
  const auto c = challenge_in(unit.feed(from, hello(SessionId{3})), from);
  unit.feed(from, token_packet(SessionId{3}, 2, c->challenge.token));
  EXPECT_EQ(unit.peers(), 2U);
  EXPECT_THAT(unit.lost, IsEmpty()) << "one place each, and nobody was silent for 15 s";
  unit.sleep(6s);
  join(unit, SessionId{3}, from);
  EXPECT_THAT(unit.lost, testing::ElementsAre(unit.ready[0]));
  EXPECT_EQ(unit.ready.size(), 3U);
}

}  // namespace
}  // namespace interneuron::join_test
