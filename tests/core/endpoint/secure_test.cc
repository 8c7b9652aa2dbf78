// Endpoints that encrypt: who is served, and what survives.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/secure/credential.h"
#include "encrypted.h"
#include "policies/builtin.h"

namespace interneuron::secure_test {
namespace {

TEST(Secure, RoundsGoThereAndBackAndNothingIsInTheClear) {
  Encrypted e;
  EXPECT_THAT(e.ready, testing::UnorderedElementsAre(e.vehicle, e.road));
  e.rounds(20);
  EXPECT_EQ(e.remote(), 20);
  for (const Pipe::Captured& c : e.captured) {
    const auto header = wire::peek(c.bytes);
    ASSERT_TRUE(header);
    if (!wire::is_handshake(header->type)) {
      EXPECT_EQ(header->epoch, wire::kSealedEpoch);
    }
  }
  for (const std::size_t host : {e.vehicle, e.road}) {
    for (const LinkId link : {kFast, kSlow}) {
      const LinkCounters c = e.pipe.at(host).link_counters(link);
      EXPECT_EQ(c.unauthentic_packets, 0U);
      EXPECT_EQ(c.malformed_packets, 0U);
    }
  }
}

TEST(Secure, WhoIsNotTrustedGetsNothing) {
  Encrypted e({3, 4});
  EXPECT_TRUE(e.ready.empty());
  EXPECT_TRUE(e.pipe.at(e.road).peers().empty());
  for (const Pipe::Captured& c : e.captured) EXPECT_EQ(c.from, e.vehicle);
}

TEST(Secure, ARoadThatBeginsANewLifeIsBackAtOnce) {
  Encrypted e;
  e.rounds(3);
  e.pipe.restart(e.road, Encrypted::road_options({kVehicleKey}, 1));
  e.rounds(30);
  EXPECT_EQ(e.restarted, 1);
  EXPECT_GE(e.remote(), 3 + 25);
}

TEST(Secure, AVehicleThatBeginsANewLifeTakesThePlaceOfItsOldOne) {
  Encrypted e;
  e.rounds(3);
  e.pipe.restart(e.vehicle, Encrypted::vehicle_options(1));
  e.peer = e.pipe.connect(e.vehicle, e.road);
  e.pipe.run(1s);
  e.rounds(5);
  EXPECT_EQ(e.remote(), 8);
  EXPECT_EQ(e.pipe.at(e.road).peers().size(), 1U);
  EXPECT_EQ(e.lost, 1);
}

TEST(Secure, KeysAreRenewedWithoutALostRound) {
  Encrypted e;
  e.rounds(5000);
  EXPECT_EQ(e.remote(), 5000);
  EXPECT_EQ(e.restarted, 0);
  const auto responses = std::ranges::count_if(e.captured, [](const Pipe::Captured& c) {
    return wire::peek(c.bytes)->type == wire::PacketType::kResponse;
  });
  // At the beginning, and 120 s to 130 s after each one before; over two paths.
  EXPECT_GE(responses, 2 * (1 + 3));
  EXPECT_LE(responses, 2 * (1 + 4));
}

// A message that must not leave over a network that is not the operator's own does not, encrypted
// or not, and nothing that repairs it either.
void expect_own_network_alone(const std::shared_ptr<const Policy>& rule) {
  Pipe pipe;
  EndpointOptions vehicle = Encrypted::vehicle_options();
  EndpointOptions road = Encrypted::road_options({kVehicleKey});
  for (EndpointOptions* o : {&vehicle, &road}) {
    o->policies.push_back(rule);
  }
  vehicle.pipelines[0].policy = rule->name();
  const std::size_t a = pipe.add_host(vehicle);
  const std::size_t b = pipe.add_host(road);
  for (const std::size_t host : {a, b}) {
    pipe.at(host).add_link(pipe.local(host), kFast, {"own", 1500, {.trusted = true}});
  }
  std::map<LinkId, int> pieces;
  int remote = 0;
  pipe.on_event = [&](std::size_t host, Event& e) {
    if (auto* d = std::get_if<Delivered>(&e); d != nullptr && host == b) {
      pipe.submit(b, d->round, 100);
    } else if (auto* r = std::get_if<RoundDone>(&e)) {
      remote += r->outcome == Outcome::kRemote ? 1 : 0;
    }
  };
  pipe.on_transmit = [&](std::size_t, std::size_t, LinkId link, const Bytes& bytes) {
    const auto type = wire::peek(bytes)->type;
    const bool is_message = type == wire::PacketType::kData || type == wire::PacketType::kWindow;
    pieces[link] += is_message ? 1 : 0;
  };
  int packet = 0;
  pipe.drop = [&packet](std::size_t, LinkId, ByteView) { return ++packet % 10 == 0; };
  const PeerId peer = pipe.connect(a, b);
  pipe.run(2s);
  for (const LinkState& link : pipe.at(a).links(pipe.local(a), peer)) {
    EXPECT_EQ(link.nature.security, link.id == kFast ? 1.0 : 0.5);
  }
  for (int i = 0; i < 100; ++i) {
    pipe.round(a, PipelineId{0}, {Bytes(20'000)});
    pipe.run(100ms);
  }
  EXPECT_GE(remote, 95);
  EXPECT_GE(pieces[kFast], 1500);
  EXPECT_EQ(pieces[kSlow], 0);
}

TEST(Secure, AFloorOfSecurityHoldsForRepairsToo) {
  expect_own_network_alone(secure(policies::coded(), 1.0, "own_networks"));
}

TEST(Secure, TrustedNetworksAloneHoldsForRepairsToo) {
  expect_own_network_alone(trusted_only(policies::coded(), "own_networks"));
}

// --- a fleet with an authority

const SecretKey kAuthority = sim::secret_key(50);

EndpointOptions signed_vehicle(int host) {
  EndpointOptions o =
      options_of(static_cast<std::uint32_t>(100 + host), {pipeline_of(kOffload)}, false);
  Security s = *sim::security_of(host, {kRoadKey});
  s.authorities = {crypto::authority_key_of(kAuthority)};
  s.credential = crypto::sign_credential(
      {sim::key_of_host(host), NodeRole::kVehicle, "vehicle", 0, 1'000'000}, kAuthority);
  o.security = std::make_shared<Security>(s);
  return o;
}

EndpointOptions signing_road(Bytes revocations = {}) {
  EndpointOptions o = options_of(22);
  Security s = *sim::security_of(kRoadKey, {});
  s.authorities = {crypto::authority_key_of(kAuthority)};
  s.revocations = std::move(revocations);
  o.security = std::make_shared<Security>(s);
  return o;
}

TEST(Secure, AVehicleThatAnAuthorityHasSignedJoinsWithoutBeingListed) {
  Pipe pipe;
  const std::size_t vehicle = pipe.add_host(signed_vehicle(3));
  const std::size_t road = pipe.add_host(signing_road());
  int ready = 0;
  pipe.on_event = [&](std::size_t, Event& e) { ready += std::holds_alternative<PeerReady>(e); };
  pipe.connect(vehicle, road);
  pipe.run(1s);
  EXPECT_EQ(ready, 2);
}

TEST(Secure, RevocationsAreHandedOnAndTakeEffectAtOnce) {
  Pipe pipe;
  const Bytes list = crypto::sign_revocations({1000, {sim::key_of_host(4)}}, kAuthority);
  // Host 3 knows the list; the road and host 4, whose key it names, do not.
  EndpointOptions knowing = signed_vehicle(3);
  Security s = *knowing.security;
  s.revocations = list;
  knowing.security = std::make_shared<Security>(s);
  const std::size_t road = pipe.add_host(signing_road());
  const std::size_t revoked = pipe.add_host(signed_vehicle(4));
  const std::size_t informed = pipe.add_host(knowing);
  std::vector<Bytes> changed;
  int lost = 0;
  pipe.on_event = [&](std::size_t host, Event& e) {
    if (auto* c = std::get_if<RevocationsChanged>(&e); c != nullptr && host == road) {
      changed.push_back(c->list);
    }
    lost += host == road && std::holds_alternative<PeerLost>(e) ? 1 : 0;
  };
  pipe.connect(revoked, road);
  pipe.run(1s);
  EXPECT_EQ(pipe.at(road).peers().size(), 1U);
  pipe.connect(informed, road);
  pipe.run(2s);
  EXPECT_EQ(changed, std::vector<Bytes>{list});
  EXPECT_EQ(lost, 1);
  EXPECT_EQ(pipe.at(road).peers().size(), 1U);
  pipe.run(20s);
  EXPECT_EQ(pipe.at(road).peers().size(), 1U);
}

TEST(Secure, OneKeyOnTwoHostsIsTold) {
  Pipe pipe;
  const std::size_t road = pipe.add_host(Encrypted::road_options({kVehicleKey}));
  const std::size_t first = pipe.add_host(Encrypted::vehicle_options(0));
  const std::size_t second = pipe.add_host(Encrypted::vehicle_options(1));
  std::vector<PublicKey> shared;
  pipe.on_event = [&](std::size_t host, Event& e) {
    if (auto* k = std::get_if<KeyShared>(&e); k != nullptr && host == road)
      shared.push_back(k->key);
  };
  pipe.connect(first, road);
  pipe.run(1s);
  EXPECT_TRUE(shared.empty());
  pipe.connect(second, road);
  pipe.run(30s);
  EXPECT_EQ(shared, std::vector<PublicKey>{sim::key_of_host(kVehicleKey)});
}

}  // namespace
}  // namespace interneuron::secure_test
