// Endpoints that encrypt: who is served, and what survives.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "encrypted.h"

namespace interneuron {
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

}  // namespace
}  // namespace interneuron
