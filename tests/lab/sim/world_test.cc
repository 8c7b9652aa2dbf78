// Behaviours of endpoints that need a network: start-up, restart, amplification, steps of time.
#include "lab/sim/world.h"

#include "support.h"

namespace interneuron::sim::world_test {
namespace {

EndpointOptions vehicle_options(std::uint32_t session) {
  PipelineConfig pipeline{.stages = {StageKind::kCommunication, StageKind::kCommunication}};
  return EndpointOptions{
      .session = SessionId{session}, .pipelines = {pipeline}, .policies = builtin_policies()};
}

EndpointOptions road_options(std::uint32_t session) {
  EndpointOptions o;
  o.session = SessionId{session};
  o.policies = builtin_policies();
  o.accept_peers = true;
  return o;
}

// A vehicle and a roadside that echoes every message.
struct Pair {
  World world{1};
  HostId vehicle = 0;
  HostId road = 0;
  PeerId peer{};
  std::vector<RoundDone> done;
  std::vector<Event> road_events;
  int restarts = 0;

  explicit Pair(std::uint32_t road_session = 2) {
    vehicle = world.add_host(vehicle_options(1));
    road = world.add_host(road_options(road_session));
    for (std::uint8_t i = 0; i < 2; ++i) {
      world.add_link(vehicle, road, LinkId{i}, i == 0 ? "a" : "b",
                     emu::Link(constant_link("c", 20.0 + 10 * i, 100, 100), i));
    }
    world.on_event([this](HostId host, Event&& event) {
      if (auto* d = std::get_if<Delivered>(&event)) {
        world.endpoint(host).submit(world.local_time(host), d->round, {d->payload},
                                    MessageClass::kResult);
      } else if (auto* r = std::get_if<RoundDone>(&event)) {
        done.push_back(*r);
      } else if (std::holds_alternative<PeerRestarted>(event)) {
        ++restarts;
      }
      if (host == road) road_events.push_back(std::move(event));
    });
    peer = world.connect(vehicle, road);
  }
  void round(std::size_t bytes) {
    Endpoint& e = world.endpoint(vehicle);
    const RoundRef ref = e.begin_round(world.local_time(vehicle), PipelineId{0});
    e.submit(world.local_time(vehicle), ref, {Bytes(bytes)}, MessageClass::kData, peer);
    world.flush(vehicle);
  }
};

TEST(World, LinksAreMeasuredWithinOneSecond) {
  Pair p;
  p.world.run_until(1s);
  const auto links = p.world.endpoint(p.vehicle).links(p.world.local_time(p.vehicle), p.peer);
  ASSERT_EQ(links.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_TRUE(links[i].up);
    EXPECT_NEAR(to_ms(links[i].rtt_p50), 20.0 + 10.0 * static_cast<double>(i), 0.5);
    EXPECT_NEAR(links[i].rate.mbit(), 100, 5);
    EXPECT_EQ(links[i].loss, 0);
  }
  EXPECT_EQ(links[0].nature.delay, 1.0);
  EXPECT_LT(links[1].nature.delay, 1.0);
}

TEST(World, AMessageGoesThereAndBack) {
  Pair p;
  p.world.run_until(1s);
  p.round(200'000);
  p.world.run_until(2s);
  ASSERT_EQ(p.done.size(), 1U);
  EXPECT_EQ(p.done[0].outcome, Outcome::kRemote);
  EXPECT_EQ(p.done[0].result.size(), 200'000U);
}

TEST(World, WithoutAPeerTheRoundEndsLocally) {
  World world(1);
  const HostId vehicle = world.add_host(vehicle_options(1));
  std::vector<RoundDone> done;
  world.on_event([&](HostId, Event&& e) {
    if (auto* r = std::get_if<RoundDone>(&e)) done.push_back(*r);
  });
  const RoundRef ref =
      world.endpoint(vehicle).begin_round(world.local_time(vehicle), PipelineId{0});
  EXPECT_EQ(world.endpoint(vehicle).submit(world.local_time(vehicle), ref, {Bytes(1)},
                                           MessageClass::kData),
            SubmitStatus::kNoPeer);
  world.flush(vehicle);
  world.run_until(1s);
  ASSERT_EQ(done.size(), 1U);
  EXPECT_EQ(done[0].outcome, Outcome::kLocal);
  EXPECT_FALSE(done[0].age_rounds);
}

TEST(World, ARestartedPeerIsRecognised) {
  Pair p;
  p.world.run_until(1s);
  p.round(1000);
  p.world.run_until(2s);
  p.world.endpoint(p.road) = Endpoint(road_options(3), p.world.local_time(p.road));
  for (std::uint8_t i = 0; i < 2; ++i) {
    p.world.endpoint(p.road).add_link(p.world.local_time(p.road), LinkId{i}, {"x", 1500});
  }
  p.world.run_until(4s);
  EXPECT_EQ(p.restarts, 1);
  p.round(1000);
  p.world.run_until(5s);
  ASSERT_EQ(p.done.size(), 2U);
  EXPECT_EQ(p.done[1].outcome, Outcome::kRemote);
}

TEST(World, ASilentLinkGoesDownAndTheOtherCarriesOn) {
  Pair p;
  p.world.run_until(1s);
  p.world.faults(LinkId{0}).cut = true;
  p.world.run_until(4s);
  const auto links = p.world.endpoint(p.vehicle).links(p.world.local_time(p.vehicle), p.peer);
  EXPECT_FALSE(links[0].up);
  EXPECT_TRUE(links[1].up);
  EXPECT_EQ(links[0].nature, Nature{});
  p.round(10'000);
  p.world.run_until(5s);
  ASSERT_EQ(p.done.size(), 1U);
  EXPECT_EQ(p.done[0].outcome, Outcome::kRemote);
}

TEST(World, LostPiecesAreRepaired) {
  Pair p;
  p.world.run_until(1s);
  p.world.faults(LinkId{0}).loss = p.world.faults(LinkId{1}).loss = 0.05;
  for (int i = 0; i < 20; ++i) {
    p.round(100'000);
    p.world.run_until(p.world.now() + 200ms);
  }
  const auto on_time = std::ranges::count(p.done, Outcome::kRemote, &RoundDone::outcome);
  EXPECT_GE(on_time, 18);  // without repair: 0.95^75 each
}

TEST(World, AnAddressThatDoesNotAnswerGetsOneChallenge) {
  // A road that accepts, and one datagram from an address that never answers.
  Endpoint road(road_options(9), TimePoint{});
  road.add_link(TimePoint{}, LinkId{0}, {"x", 1500});
  Endpoint vehicle(vehicle_options(8), TimePoint{});
  vehicle.add_link(TimePoint{}, LinkId{0}, {"x", 1500});
  const std::pair<LinkId, Address> to[] = {{LinkId{0}, World::address_of(1, LinkId{0})}};
  vehicle.connect(TimePoint{}, to);
  std::array<std::byte, kMaxDatagramBytes> buffer;
  const auto first = vehicle.poll_transmit(TimePoint{}, buffer);
  ASSERT_TRUE(first);
  TimePoint now{};
  road.handle_datagram(
      now, {LinkId{0}, World::address_of(0, LinkId{0}), std::span(buffer).first(first->size)});
  std::vector<std::size_t> sent;
  for (int i = 0; i < 1000; ++i) {
    now += 50ms;
    road.handle_timeout(now);
    while (const auto t = road.poll_transmit(now, buffer)) sent.push_back(t->size);
  }
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_LE(sent.front(), first->size);
  EXPECT_TRUE(road.peers().empty());
}

TEST(World, TimeThatGoesBackIsAddedUp) {
  Endpoint e(vehicle_options(1), TimePoint{10s});
  e.begin_round(TimePoint{10s}, PipelineId{0});
  e.handle_timeout(TimePoint{5s});  // the host's clock went back by five seconds
  EXPECT_FALSE(e.poll_event());
  ASSERT_TRUE(e.next_timeout());
  EXPECT_EQ(*e.next_timeout(), TimePoint{5s + 130ms});
  e.handle_timeout(TimePoint{5s + 130ms});
  const auto event = e.poll_event();
  ASSERT_TRUE(event);
  EXPECT_EQ(std::get<RoundDone>(*event).e2e, 130ms);
}

TEST(World, AForwardJumpAnswersOpenRoundsAtOnce) {
  Endpoint e(vehicle_options(1), TimePoint{10s});
  e.begin_round(TimePoint{10s}, PipelineId{0});
  e.handle_timeout(TimePoint{10h});
  const auto event = e.poll_event();
  ASSERT_TRUE(event);
  EXPECT_EQ(std::get<RoundDone>(*event).outcome, Outcome::kLocal);
}

TEST(World, GarbageIsCountedAndDropped) {
  Pair p;
  p.world.run_until(1s);
  Endpoint& road = p.world.endpoint(p.road);
  const auto before = road.link_counters(LinkId{0});
  Bytes noise(100, std::byte{0x0a});
  road.handle_datagram(p.world.local_time(p.road),
                       {LinkId{0}, World::address_of(0, LinkId{0}), noise});
  road.handle_datagram(p.world.local_time(p.road),
                       {LinkId{0}, World::address_of(0, LinkId{0}), {}});
  EXPECT_EQ(road.link_counters(LinkId{0}).malformed_packets, before.malformed_packets + 2);
}

}  // namespace
}  // namespace interneuron::sim::world_test
