#include "plan/budget.h"

#include <algorithm>

namespace interneuron {
namespace {

constexpr Duration kReserve =
    std::chrono::milliseconds(5);  // chosen: D_N "less raw uplink, downlink and 5 ms"

}  // namespace

Duration compute_budget(Duration deadline, std::span<const LinkState> links,
                        std::size_t best_variant_bytes, std::size_t result_bytes) {
  Duration best = Duration::max();
  for (const LinkState& link : links) {
    if (!link.up || link.rate.bits_per_second <= 0 || link.rtt_p50 <= Duration::zero()) continue;
    const Duration transfer = link.rate.transmit_time(best_variant_bytes + result_bytes);
    best = std::min(best, std::min<Duration>(transfer, std::chrono::hours(1)) + link.rtt_p50);
  }
  if (best == Duration::max()) return Duration::zero();
  return std::max(Duration::zero(), deadline - best - kReserve);
}

}  // namespace interneuron
