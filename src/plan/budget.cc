#include "plan/budget.h"

#include <algorithm>

namespace interneuron {
namespace {

// Fragment, packet, UDP and IPv4 headers around each 1,352 bytes of a message
// (docs/wire_format.md).
constexpr double kWireOverhead = 1428.0 / 1352.0;

}  // namespace

Duration compute_budget(Duration deadline, std::span<const LinkState> links,
                        std::size_t best_variant_bytes, std::size_t result_bytes) {
  Duration best = Duration::max();
  for (const LinkState& link : links) {
    if (!link.up || link.rate.bits_per_second <= 0 || link.rtt_p50 <= Duration::zero()) continue;
    const auto wire_bytes = static_cast<std::size_t>(
        static_cast<double>(best_variant_bytes + result_bytes) * kWireOverhead);
    const Duration transfer = link.rate.transmit_time(wire_bytes);
    best = std::min(best, std::min<Duration>(transfer, std::chrono::hours(1)) + link.rtt_p50);
  }
  if (best == Duration::max()) return Duration::zero();
  return std::max(Duration::zero(), deadline - best - kComputeReserve);
}

}  // namespace interneuron
