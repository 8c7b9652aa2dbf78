// Who becomes a peer: only whoever receives what is sent to the address that it asks from; and
// nobody can keep others out, or be made to flood others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>

#include "core/peers/address_validation.h"
#include "core/wire/packet.h"
#include "core/wire/round_header.h"
#include "interneuron/endpoint.h"
#include "pair.h"

namespace interneuron::join_test {
namespace {

using testing::IsEmpty;

constexpr SessionId kRoad{1000};

// 10.net.subnet.host:port as a sockaddr_in has it.
Address ipv4(std::uint8_t net, std::uint8_t subnet, std::uint8_t host, std::uint16_t port = 1) {
  Address a;
  a.size = 16;
  a.raw[0] = std::byte{2};
  a.raw[2] = static_cast<std::byte>(port >> 8U);
  a.raw[3] = static_cast<std::byte>(port);
  a.raw[4] = std::byte{10};
  a.raw[5] = std::byte{net};
  a.raw[6] = std::byte{subnet};
  a.raw[7] = std::byte{host};
  return a;
}

struct Sent {
  LinkId link{};
  Address to{};
  Bytes bytes;
};

// A roadside unit whose datagrams are made by hand.
struct Unit {
  Endpoint endpoint;
  TimePoint now{1h};
  std::vector<PeerId> ready;
  std::vector<PeerId> lost;
  int delivered = 0;

  explicit Unit(std::size_t max_peers = 8, bool accept = true) : endpoint(make(max_peers, accept)) {
    for (const LinkId link : {kFast, kSlow}) endpoint.add_link(now, link, {"nic", 1500});
  }
  static Endpoint make(std::size_t max_peers, bool accept) {
    EndpointOptions o = options_of(kRoad.value, {pipeline_of({kComm, kComm})}, accept);
    o.max_peers = max_peers;
    o.secret = {0x0123456789abcdef, 0xfedcba9876543210};
    return Endpoint(std::move(o), TimePoint{1h});
  }
  std::vector<Sent> feed(const Address& from, ByteView bytes, LinkId link = kFast) {
    endpoint.handle_datagram(now, {link, from, bytes});
    return drain();
  }
  std::vector<Sent> drain() {
    std::vector<Sent> out;
    std::array<std::byte, kMaxDatagramBytes> buffer;
    while (const auto event = endpoint.poll_event()) {
      if (const auto* e = std::get_if<PeerReady>(&*event)) ready.push_back(e->peer);
      if (const auto* e = std::get_if<PeerLost>(&*event)) lost.push_back(e->peer);
      delivered += std::holds_alternative<Delivered>(*event) ? 1 : 0;
    }
    while (const auto t = endpoint.poll_transmit(now, buffer)) {
      out.push_back({t->link, t->to,
                     Bytes(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(t->size))});
    }
    return out;
  }
  std::vector<Sent> sleep(Duration by) {
    std::vector<Sent> out;
    for (const TimePoint end = now + by;;) {
      const auto next = endpoint.next_timeout();
      now = std::min(end, std::max(now, next.value_or(end)));
      endpoint.handle_timeout(now);
      for (Sent& s : drain()) out.push_back(std::move(s));
      if (now == end) return out;
    }
  }
  std::size_t peers() const { return endpoint.peers().size(); }
};

wire::PacketHeader header_of(wire::PacketType type, SessionId session, std::uint64_t number,
                             LinkId path = LinkId{0}) {
  return {type, path, wire::kClearEpoch, session, number};
}

Bytes hello(SessionId session, std::uint64_t number = 1, SessionId echo = {},
            LinkId path = LinkId{0}) {
  Bytes out(kMaxDatagramBytes);
  wire::Feedback feedback;
  feedback.u = static_cast<std::int64_t>(number);
  feedback.echo = echo;
  out.resize(wire::write_feedback(
      out, header_of(wire::PacketType::kFeedback, session, number, path), feedback));
  return out;
}

Bytes token_packet(SessionId session, std::uint64_t number, const wire::Token& token,
                   LinkId path = LinkId{0}) {
  Bytes out(kMaxDatagramBytes);
  out.resize(
      wire::write_token(out, header_of(wire::PacketType::kToken, session, number, path), token));
  return out;
}

// The challenge among what was sent to this address.
std::optional<wire::Packet> challenge_in(const std::vector<Sent>& sent, const Address& to) {
  for (const Sent& s : sent) {
    const auto packet = wire::parse(s.bytes);
    if (s.to == to && packet && packet->header.type == wire::PacketType::kChallenge) return packet;
  }
  return std::nullopt;
}

// Asks, and answers the challenge. `ready`: it also shows that it has heard the unit.
void join(Unit& unit, SessionId session, const Address& from, bool ready = true) {
  const auto challenge = challenge_in(unit.feed(from, hello(session)), from);
  ASSERT_TRUE(challenge);
  unit.feed(from, token_packet(session, 2, challenge->challenge.token));
  if (ready) unit.feed(from, hello(session, 3, kRoad));
}

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
