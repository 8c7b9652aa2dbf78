// PassedPackets: what became of the packets of a path, in the order in which they left.
#include <algorithm>

#include "core/flow/packet_log.h"

namespace interneuron::flow {

std::span<const link::Passage> PassedPackets::told(const PacketLog& log) {
  passed_.clear();
  first_untold_ = std::max(first_untold_, log.oldest());
  for (; log.keeps(first_untold_); ++first_untold_) {
    const PacketLog::Packet& packet = log.at(first_untold_);
    if (!packet.data_sized || packet.mtu_probe) continue;
    if (packet.fate == PacketLog::Fate::kOpen) break;
    const bool arrived = packet.fate == PacketLog::Fate::kArrived;
    passed_.push_back({packet.at, log.data_of(packet).bytes, arrived});
  }
  return passed_;
}

}  // namespace interneuron::flow
