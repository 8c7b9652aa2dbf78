// Two hosts by their sessions: which cipher they come to seal with, and when they shake hands again
// because a key has sealed as much as it may.
#include "core/secure/sessions.h"

#include <gtest/gtest.h>

#include "core/wire/packet.h"
#include "lab/sim/trust.h"

namespace interneuron::crypto::sessions_test {
namespace {

using namespace std::chrono_literals;

constexpr LinkId kNic{1};
constexpr LinkId kPath{3};
constexpr Sessions::Owner kOwner = 0;

Bytes probe(std::uint64_t number) {
  Bytes out(wire::kPacketOverhead);
  wire::write_probe(out, {wire::PacketType::kProbe, kPath, wire::kClearEpoch, SessionId{7}, number},
                    out.size());
  return out;
}

struct Two {
  TimePoint now{1h};
  Sessions vehicle;
  Sessions road;
  std::array<std::byte, kMaxDatagramBytes> opened{};

  Two(Ciphers of_vehicle, Ciphers of_road)
      : vehicle(*sim::security_of(1, {2}), SessionId{9}, false, now, of_vehicle),
        road(*sim::security_of(2, {1}), SessionId{22}, true, now, of_road) {
    vehicle.connect(now, kOwner, sim::key_of_host(2));
    shake();
  }
  void shake() {
    ASSERT_TRUE(is_due());
    Bytes asked(kMaxDatagramBytes);
    asked.resize(vehicle.write_initiation(kOwner, kPath, asked));
    vehicle.initiation_sent(now, kOwner);
    ASSERT_TRUE(road.take_handshake(now, *wire::peek(asked), {kNic, {}, asked}).is_used);
    const std::uint32_t index = road.responder().next()->index;
    Bytes told(kMaxDatagramBytes);
    told.resize(road.responder().write(told, {}));
    ASSERT_TRUE(vehicle.take_handshake(now, *wire::peek(told), {kNic, {}, told}).answered);
    if (!road.is_open(now, kOwner)) road.adopt(kOwner, index);
  }
  bool is_due() {
    vehicle.handle_timeout(now, kOwner);
    return vehicle.initiation_due(now, kOwner);
  }
  Bytes sealed(Sessions& by, std::uint64_t number) {
    Bytes out = probe(number);
    EXPECT_TRUE(by.seal(now, kOwner, out));
    return out;
  }
  bool opens(Sessions& by, const Bytes& packet) {
    return by.open(now, *wire::peek(packet), packet, opened).result == Session::Opened::kOk;
  }
};

TEST(Sessions, WhateverTheTwoHaveTheyUnderstandEachOther) {
  for (const Ciphers of_vehicle : {Ciphers{0}, ciphers_here()}) {
    for (const Ciphers of_road : {Ciphers{0}, ciphers_here()}) {
      Two two(of_vehicle, of_road);
      // Two more handshakes, each two minutes later.
      for (std::uint64_t number = 1; number <= 3; ++number) {
        EXPECT_TRUE(two.opens(two.road, two.sealed(two.vehicle, number)));
        EXPECT_TRUE(two.opens(two.vehicle, two.sealed(two.road, number)));
        two.now += 131s;
        if (number < 3) two.shake();
      }
    }
  }
}

// Where the road has used them up, the vehicle renews them: nobody else can.
TEST(Sessions, KeysOfAesAreRenewedBeforeTheyHaveSealedAllTheyMay) {
  if (ciphers_here() == 0) GTEST_SKIP() << "this machine has no AES";
  Two two(ciphers_here(), ciphers_here());
  ASSERT_TRUE(two.opens(two.road, two.sealed(two.vehicle, 1)));
  two.now += 5s;
  std::uint64_t number = 0;
  while (++number < Session::kMostPackets / 2) {
    ASSERT_TRUE(two.opens(two.vehicle, two.sealed(two.road, number)));
  }
  EXPECT_FALSE(two.is_due());
  ASSERT_TRUE(two.opens(two.vehicle, two.sealed(two.road, number)));
  ASSERT_TRUE(two.is_due());
  two.shake();
  EXPECT_FALSE(two.is_due());
  EXPECT_TRUE(two.opens(two.road, two.sealed(two.vehicle, 2)));
  EXPECT_TRUE(two.opens(two.vehicle, two.sealed(two.road, ++number)));
}

constexpr std::uint8_t kShards = 3;

// A unit of several shards, and hosts that ask it for sessions.
struct Unit {
  static constexpr int kRoad = 100;
  TimePoint now{1h};
  std::vector<int> hosts;
  Sessions door;
  std::vector<std::unique_ptr<Sessions>> shards;

  explicit Unit(int count)
      : hosts(numbers(count)),
        door(*sim::security_of(kRoad, hosts), SessionId{22}, true, now, Ciphers{0},
             Shard{kShards}) {
    for (std::uint8_t i = 1; i <= kShards; ++i) {
      shards.push_back(std::make_unique<Sessions>(*sim::security_of(kRoad, hosts, i), SessionId{22},
                                                  true, now, Ciphers{0}, Shard{kShards, i}));
    }
  }
  static std::vector<int> numbers(int count) {
    std::vector<int> out;
    for (int i = 1; i <= count; ++i) out.push_back(i);
    return out;
  }
  std::unique_ptr<Sessions> host(int number, int life = 0) const {
    auto out = std::make_unique<Sessions>(*sim::security_of(number, {kRoad}, life),
                                          SessionId{static_cast<std::uint32_t>(900 + life)}, false,
                                          now, Ciphers{0});
    out->connect(now, kOwner, sim::key_of_host(kRoad));
    return out;
  }
  Bytes initiation(Sessions& by, LinkId path = kPath) const {
    EXPECT_TRUE(by.initiation_due(now, kOwner));
    Bytes out(kMaxDatagramBytes);
    out.resize(by.write_initiation(kOwner, path, out));
    return out;
  }
  Sessions::Shaken ask(Sessions& of, const Bytes& packet) const {
    return of.take_handshake(now, *wire::peek(packet), {kNic, {}, packet});
  }
};

TEST(Sessions, TheDoorGivesEachKeyAShard) {
  constexpr int kHosts = 2 * kShards;
  Unit unit(kHosts);
  for (int life = 0; life < 2; ++life) {
    for (int host = 1; host <= kHosts; ++host) {
      const auto vehicle = unit.host(host, life);
      const Bytes asked = unit.initiation(*vehicle);
      const auto shaken = unit.ask(unit.door, asked);
      ASSERT_EQ(shaken.shard, (host - 1) % kShards + 1);
      EXPECT_FALSE(unit.door.responder().next());
      // A copy over another path goes there too, and the same one once more nowhere.
      EXPECT_EQ(unit.ask(unit.door, unit.initiation(*vehicle, LinkId{7})).shard, shaken.shard);
      EXPECT_EQ(unit.ask(unit.door, asked).shard, 0);
      Sessions& shard = *unit.shards[shaken.shard - 1U];
      EXPECT_TRUE(unit.ask(shard, asked).is_used);
      const auto next = shard.responder().next();
      ASSERT_TRUE(next);
      EXPECT_EQ(shard_of_byte(static_cast<std::uint8_t>(next->index), kShards), shaken.shard);
      Bytes told(kMaxDatagramBytes);
      told.resize(shard.responder().write(told, {}));
      EXPECT_TRUE(unit.ask(*vehicle, told).answered);
    }
  }
}

// What is let in is counted at the door, and the shards answer all that it hands on.
TEST(Sessions, TheDoorAloneAsksForCookies) {
  constexpr int kHosts = 90;
  constexpr int kFreely = Responder::kFreely;
  Unit unit(kHosts);
  int handed_on = 0;
  int cookies = 0;
  for (int host = 1; host <= kHosts; ++host) {
    const auto vehicle = unit.host(host);
    const Bytes asked = unit.initiation(*vehicle);
    const auto shaken = unit.ask(unit.door, asked);
    if (shaken.shard == 0) {
      cookies += shaken.is_used ? 1 : 0;
      continue;
    }
    ++handed_on;
    EXPECT_TRUE(unit.ask(*unit.shards[shaken.shard - 1U], asked).is_used);
  }
  EXPECT_NEAR(handed_on, kFreely, 1);
  EXPECT_EQ(cookies, kHosts - handed_on);
}

TEST(Entropy, NumbersOfSessionsTellTheShard) {
  Entropy entropy(sim::secret_key(3));
  for (const unsigned number : {1U, 2U, 3U, 7U, 64U, 255U}) {
    const auto count = static_cast<std::uint8_t>(number);
    for (int i = 0; i < 50; ++i) {
      const auto index = static_cast<std::uint8_t>(1 + i % count);
      const std::uint32_t drawn = entropy.draw_index({count, index});
      EXPECT_NE(drawn, 0U);
      EXPECT_EQ(shard_of_byte(static_cast<std::uint8_t>(drawn), count), index);
    }
  }
}

}  // namespace
}  // namespace interneuron::crypto::sessions_test
