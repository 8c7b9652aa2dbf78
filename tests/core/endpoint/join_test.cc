// Who becomes a peer: only whoever receives what is sent to the address that it asks from; and
// nobody can be made to flood others.
#include "join.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>

#include "core/peers/address_validation.h"

namespace interneuron::join_test {
namespace {

using testing::IsEmpty;

TEST(Join, AnAddressCostsNothingBeforeItHasAnsweredAChallenge) {
  Unit unit;
  const Address from = ipv4(0, 0, 1);
  const Bytes asked = hello(SessionId{5}, 7);
  const auto sent = unit.feed(from, asked);
  ASSERT_EQ(sent.size(), 1U);
  const auto challenge = challenge_in(sent, from);
  ASSERT_TRUE(challenge);
  EXPECT_EQ(challenge->header.session, kRoad);
  EXPECT_EQ(challenge->header.number, 7U);
  EXPECT_EQ(challenge->challenge.echo, SessionId{5});
  EXPECT_LE(sent.front().bytes.size() + kIpUdpBytes, 3 * (wire::kPacketOverhead + kIpUdpBytes));
  EXPECT_EQ(unit.peers(), 0U);
  EXPECT_THAT(unit.sleep(10s), IsEmpty());

  unit.feed(from, asked);
  unit.feed(from, hello(SessionId{5}, 8, kRoad));
  EXPECT_EQ(unit.peers(), 0U) << "everybody is told our session";
  EXPECT_THAT(unit.ready, IsEmpty());
}

TEST(Join, ATokenIsGoodForItsAddressPathSessionAndTimeOnly) {
  Unit unit;
  const Address from = ipv4(0, 0, 1);
  const auto challenge = challenge_in(unit.feed(from, hello(SessionId{5})), from);
  ASSERT_TRUE(challenge);
  const wire::Token token = challenge->challenge.token;
  wire::Token wrong = token;
  wrong.back() ^= std::byte{1};
  unit.feed(from, token_packet(SessionId{5}, 2, wrong));
  unit.feed(ipv4(0, 0, 2), token_packet(SessionId{5}, 2, token));
  unit.feed(ipv4(0, 0, 1, 2), token_packet(SessionId{5}, 2, token));
  unit.feed(from, token_packet(SessionId{6}, 2, token));
  unit.feed(from, token_packet(SessionId{5}, 2, token, LinkId{1}));
  unit.feed(from, token_packet(SessionId{5}, 2, token), kSlow);
  EXPECT_EQ(unit.peers(), 0U);
  unit.sleep(peers::AddressValidation::kEpoch);
  unit.feed(from, token_packet(SessionId{5}, 2, token));
  EXPECT_EQ(unit.peers(), 1U);

  Unit later;
  const auto first = challenge_in(later.feed(from, hello(SessionId{5})), from);
  later.sleep(2 * peers::AddressValidation::kEpoch);
  later.feed(from, token_packet(SessionId{5}, 2, first->challenge.token));
  EXPECT_EQ(later.peers(), 0U) << "it is too old";
}

// Vehicles that are switched on together ask together, and again a sixteenth of a second later.
TEST(Join, AThousandWhoAskAtOneInstantAreChallengedAtOnce) {
  Unit unit;
  std::size_t challenged = 0;
  for (std::uint16_t i = 0; i < 1000; ++i) {
    const Address from =
        ipv4(1, static_cast<std::uint8_t>(i / 250), static_cast<std::uint8_t>(i % 250));
    challenged += unit.feed(from, hello(SessionId{2000U + i})).size();
  }
  EXPECT_EQ(challenged, 1000U);
}

// Whatever somebody sends in the name of an address that does not answer challenges, that address
// gets at most three times as many bytes, IP headers included.
RC_GTEST_PROP(Join, AnAddressThatDoesNotAnswerGetsAtMostThreeTimesWhatIsSentInItsName, ()) {
  Unit unit;
  std::map<std::uint8_t, std::size_t> came;
  std::map<std::uint8_t, std::size_t> went;
  // One that is served, so that there is something to send.
  join(unit, SessionId{99}, ipv4(9, 9, 9));
  const auto note = [&went](const std::vector<Sent>& sent) {
    for (const Sent& s : sent) {
      if (s.to.raw[5] != std::byte{0}) continue;
      went[std::to_integer<std::uint8_t>(s.to.raw[7])] += s.bytes.size() + kIpUdpBytes;
    }
  };
  const int steps = *rc::gen::inRange(1, 200);
  for (int i = 0; i < steps; ++i) {
    const auto victim = *rc::gen::inRange<std::uint8_t>(1, 4);
    // The session of the served peer, too: whoever has overheard it.
    const SessionId session{*rc::gen::element<std::uint32_t>(5, 6, 99)};
    const LinkId path{*rc::gen::inRange<std::uint16_t>(0, 9)};
    Bytes bytes = hello(session, 10 + static_cast<std::uint64_t>(i),
                        *rc::gen::element(SessionId{}, kRoad), path);
    if (*rc::gen::arbitrary<bool>()) {
      bytes.resize(kMaxDatagramBytes);
      bytes.resize(wire::write_probe(
          bytes, header_of(wire::PacketType::kProbe, session, 10U + static_cast<unsigned>(i), path),
          *rc::gen::inRange<std::size_t>(36, 1200)));
    }
    came[victim] += bytes.size() + kIpUdpBytes;
    note(unit.feed(ipv4(0, 0, victim), bytes, *rc::gen::element(kFast, kSlow)));
    note(unit.sleep(*rc::gen::element<Duration>(0ms, 1ms, 30ms, 1s)));
  }
  note(unit.sleep(70s));
  for (const auto& [victim, bytes] : went) RC_ASSERT(bytes <= 3 * came[victim]);
}

// What leaves the port of a peer changes where it is sent to only once it is proved, and meanwhile
// nothing is lost.
TEST(Join, APathMovesOnceItsNewAddressIsProved) {
  Unit unit;
  const Address before = ipv4(1, 0, 1, 1);
  const Address after = ipv4(1, 0, 1, 2);
  join(unit, SessionId{1}, before);
  const auto sent = unit.feed(after, hello(SessionId{1}, 10, kRoad));
  const auto challenge = challenge_in(sent, after);
  ASSERT_TRUE(challenge);
  for (const Sent& s : unit.sleep(1s)) EXPECT_EQ(s.to, before);
  unit.feed(before, token_packet(SessionId{1}, 11, challenge->challenge.token));
  for (const Sent& s : unit.sleep(1s)) EXPECT_EQ(s.to, before) << "it was sent from elsewhere";
  // Sent again later, what was overheard moves nothing.
  const Bytes proof = token_packet(SessionId{1}, 12, challenge->challenge.token);
  unit.feed(after, proof);
  const auto to_new = unit.sleep(1s);
  EXPECT_FALSE(to_new.empty());
  for (const Sent& s : to_new) EXPECT_EQ(s.to, after);
  unit.feed(before, hello(SessionId{1}, 9, kRoad));
  unit.feed(before, proof);
  for (const Sent& s : unit.sleep(1s)) EXPECT_EQ(s.to, after);
  EXPECT_EQ(unit.peers(), 1U);
}

// A vehicle answers only those that it has asked, and only where they repeat its session.
TEST(Join, AChallengeIsAnsweredWhereItWasAskedFor) {
  Unit vehicle(8, false);
  const Address road = ipv4(7, 0, 1);
  const std::pair<LinkId, Address> to[] = {{kFast, road}};
  vehicle.endpoint.connect(vehicle.now, to);
  vehicle.drain();
  const wire::Token token{std::byte{42}};
  const auto challenge = [&](SessionId echo) {
    Bytes out(kMaxDatagramBytes);
    out.resize(wire::write_challenge(
        out, header_of(wire::PacketType::kChallenge, SessionId{77}, 1, kFast), {echo, token}));
    return out;
  };
  EXPECT_THAT(vehicle.feed(road, challenge(SessionId{5})), IsEmpty());
  EXPECT_THAT(vehicle.feed(ipv4(7, 0, 2), challenge(kRoad)), IsEmpty());
  EXPECT_THAT(vehicle.feed(road, challenge(kRoad), kSlow), IsEmpty());
  EXPECT_EQ(vehicle.endpoint.link_counters(kFast).refused_packets, 2U);
  const auto sent = vehicle.feed(road, challenge(kRoad));
  ASSERT_EQ(sent.size(), 1U);
  const auto packet = wire::parse(sent.front().bytes);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header.type, wire::PacketType::kToken);
  EXPECT_EQ(packet->token, token);
}

// A roadside unit tells its session to all who ask: nobody else can use it from elsewhere, neither
// to bring messages nor, with a huge number, to make what it sends look old.
TEST(Join, TheSessionOfARoadsideUnitIsOfNoUseElsewhere) {
  Pair p;
  p.rounds(2);
  for (const LinkId link : {kFast, kSlow}) {
    Bytes forged(kMaxDatagramBytes);
    forged.resize(wire::write_probe(
        forged, header_of(wire::PacketType::kProbe, SessionId{2}, UINT64_MAX, link), 100));
    p.pipe.at(p.vehicle).handle_datagram(p.pipe.local(p.vehicle), {link, address_of(77), forged});
  }
  p.pipe.flush(p.vehicle);
  p.rounds(5);
  ASSERT_EQ(p.done.size(), 7U);
  for (const RoundDone& done : p.done) EXPECT_EQ(done.outcome, Outcome::kRemote);
}

// Whoever forges the address of a roadside unit without having heard the vehicle restarts nothing.
TEST(Join, ABlindRestartIsNone) {
  Pair p;
  p.rounds(2);
  for (std::uint32_t session = 500; session < 600; ++session) {
    for (const LinkId link : {kFast, kSlow}) {
      const Bytes forged = hello(SessionId{session}, 1, SessionId{session + 1}, link);
      p.pipe.at(p.vehicle).handle_datagram(p.pipe.local(p.vehicle),
                                           {link, address_of(p.road), forged});
    }
  }
  p.pipe.flush(p.vehicle);
  p.rounds(5);
  EXPECT_EQ(p.restarted, 0);
  ASSERT_EQ(p.done.size(), 7U);
  for (const RoundDone& done : p.done) EXPECT_EQ(done.outcome, Outcome::kRemote);
}

// Both have connected to each other and neither accepts anybody: each proves itself to the other.
TEST(Join, TwoThatHaveConnectedToEachOtherMeet) {
  Pipe pipe;
  int ready = 0;
  pipe.on_event = [&ready](std::size_t, Event& e) {
    ready += std::holds_alternative<PeerReady>(e);
  };
  pipe.add_host(options_of(1, {pipeline_of(kOffload)}, false));
  pipe.add_host(options_of(2, {pipeline_of(kOffload)}, false));
  pipe.connect(0, 1);
  pipe.connect(1, 0);
  pipe.run(1s);
  EXPECT_EQ(ready, 2);
}

}  // namespace
}  // namespace interneuron::join_test
