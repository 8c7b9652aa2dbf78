#include "lab/sim/round_of_packet.h"

#include "core/wire/packet.h"
#include "core/wire/round_header.h"

namespace interneuron::sim {

std::optional<RoundId> RoundOfPacket::of(ByteView datagram) {
  const auto packet = wire::parse(datagram);
  if (!packet || packet->header.type != wire::PacketType::kData) return std::nullopt;
  const wire::FragmentHeader& fragment = packet->data.fragment;
  if (fragment.index == 0) {
    const auto header = wire::parse_round_header(packet->data.bytes);
    if (header) rounds_[fragment.message] = header->round.round;
  }
  const auto known = rounds_.find(fragment.message);
  if (known == rounds_.end()) return std::nullopt;
  return known->second;
}

}  // namespace interneuron::sim
