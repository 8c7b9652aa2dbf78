// Endpoints that encrypt: who is served, what survives, and what nobody else can do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/secure/handshake.h"
#include "core/secure/session.h"
#include "pair.h"
#include "tests/trust.h"

namespace interneuron {
namespace {

constexpr int kVehicleKey = 1;
constexpr int kRoadKey = 2;

struct Encrypted {
  Pipe pipe;
  std::size_t vehicle = 0;
  std::size_t road = 0;
  PeerId peer{};
  std::vector<Delivered> delivered;
  std::vector<RoundDone> done;
  std::vector<std::size_t> ready;
  int restarted = 0;
  int lost = 0;
  std::vector<Pipe::Captured> captured;

  explicit Encrypted(std::initializer_list<int> trusted = {kVehicleKey}) {
    vehicle = pipe.add_host(vehicle_options());
    road = pipe.add_host(road_options(trusted), 1h);
    pipe.capture = &captured;
    pipe.on_event = [this](std::size_t host, Event& e) {
      if (auto* d = std::get_if<Delivered>(&e)) {
        delivered.push_back(*d);
        if (host == road) pipe.plan(5ms, [this, r = d->round] { pipe.submit(road, r, 100); });
      } else if (auto* r = std::get_if<RoundDone>(&e)) {
        done.push_back(*r);
      } else if (std::holds_alternative<PeerReady>(e)) {
        ready.push_back(host);
      } else if (std::holds_alternative<PeerRestarted>(e)) {
        ++restarted;
      } else if (std::holds_alternative<PeerLost>(e)) {
        ++lost;
      }
    };
    peer = pipe.connect(vehicle, road);
    pipe.run(1s);
  }
  static EndpointOptions vehicle_options(int life = 0) {
    EndpointOptions o =
        options_of(11 + static_cast<std::uint32_t>(life), {pipeline_of(kOffload)}, false);
    o.security = security_of(kVehicleKey, {kRoadKey}, life);
    return o;
  }
  static EndpointOptions road_options(std::initializer_list<int> trusted, int life = 0) {
    EndpointOptions o = options_of(22 + static_cast<std::uint32_t>(life));
    o.security = security_of(kRoadKey, trusted, life);
    return o;
  }
  void rounds(int count) {
    for (int i = 0; i < count; ++i) {
      pipe.round(vehicle, PipelineId{0}, {Bytes(20'000), Bytes(5'000)});
      pipe.run(100ms);
    }
  }
  int remote() const {
    return static_cast<int>(std::ranges::count(done, Outcome::kRemote, &RoundDone::outcome));
  }
};

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

}  // namespace
}  // namespace interneuron
