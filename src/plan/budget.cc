#include "plan/budget.h"

#include <algorithm>

#include "plan/wire_size.h"

namespace interneuron {
Duration compute_budget(Duration deadline, std::span<const LinkState> links,
                        std::size_t best_variant_bytes, std::size_t result_bytes) {
  Duration best = Duration::max();
  for (const LinkState& link : links) {
    if (!link.up || link.rate.bits_per_second <= 0 || link.rtt_p50 <= Duration::zero()) continue;
    const Duration transfer = link.rate.transmit_time(wire_size(best_variant_bytes + result_bytes));
    best = std::min(best, std::min<Duration>(transfer, std::chrono::hours(1)) + link.rtt_p50);
  }
  if (best == Duration::max()) return Duration::zero();
  return std::max(Duration::zero(), deadline - best - kComputeReserve);
}

}  // namespace interneuron
