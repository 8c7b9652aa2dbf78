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

}  // namespace
}  // namespace interneuron::crypto::sessions_test
