#include "lab/sim/round_of_packet.h"

#include <gtest/gtest.h>

#include <set>

#include "core/wire/packet.h"
#include "support.h"

namespace interneuron::sim {
namespace {

constexpr std::uint32_t kRounds = 5;

// Shows every packet of a short run to `look`, with the host that sent it.
void watch(const std::function<void(HostId, ByteView)>& look) {
  OffloadOptions options = drive(1, kRounds);
  run_offload(options, [&look](World& world) {
    world.on_sent([&look](HostId from, LinkId, ByteView datagram) { look(from, datagram); });
  });
}

std::optional<wire::Packet> data_packet(ByteView datagram) {
  auto packet = wire::parse(datagram);
  if (packet && packet->header.type != wire::PacketType::kData) packet.reset();
  return packet;
}

TEST(RoundOfPacket, KnowsTheRoundOfEveryDataPacketAndOfNoOther) {
  RoundOfPacket rounds[2];
  std::set<std::uint32_t> seen[2];
  watch([&](HostId from, ByteView datagram) {
    const auto round = rounds[from].of(datagram);
    EXPECT_EQ(round.has_value(), data_packet(datagram).has_value());
    if (round) seen[from].insert(round->value);
  });
  EXPECT_EQ(seen[0].size(), kRounds);
  EXPECT_EQ(seen[1].size(), kRounds);
}

TEST(RoundOfPacket, PiecesOfAMessageWithoutItsFirstOneAreOfNoRound) {
  RoundOfPacket rounds;
  std::size_t later_pieces = 0;
  watch([&](HostId from, ByteView datagram) {
    const auto packet = data_packet(datagram);
    if (from != 0 || !packet || packet->data.fragment.index == 0) return;
    ++later_pieces;
    EXPECT_EQ(rounds.of(datagram), std::nullopt);
  });
  EXPECT_GT(later_pieces, 100u);
}

}  // namespace
}  // namespace interneuron::sim
