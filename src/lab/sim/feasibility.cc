#include "lab/sim/feasibility.h"

#include <algorithm>

#include "core/wire/packet.h"
#include "core/wire/round_header.h"
#include "interneuron/endpoint.h"

namespace interneuron::sim {

std::size_t bytes_on_wire(std::size_t message_bytes) {
  const std::size_t bytes = message_bytes + wire::kRoundHeaderBytes;
  const std::size_t packets = (bytes + kMaxPieceBytes - 1) / kMaxPieceBytes;
  return bytes + packets * (kPieceOverheadBytes + kIpUdpBytes);
}

bool clairvoyant_feasible(const std::vector<emu::LinkProfile>& profiles,
                          const std::vector<emu::DelayProcess*>& processes, Duration t0,
                          Duration deadline, std::size_t smallest_bytes, std::size_t result_bytes,
                          Duration fastest_compute) {
  Duration at_road = Duration::max();
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    const Duration sent = t0 + profiles[i].up.rate.transmit_time(bytes_on_wire(smallest_bytes));
    at_road = std::min(at_road, sent + processes[i]->at(sent).rtt / 2);
  }
  const Duration computed = at_road + fastest_compute;
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    const Duration sent =
        computed + profiles[i].down.rate.transmit_time(bytes_on_wire(result_bytes));
    if (sent + processes[i]->at(sent).rtt / 2 <= t0 + deadline) return true;
  }
  return false;
}

}  // namespace interneuron::sim
