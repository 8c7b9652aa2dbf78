#include "core/plan/budget.h"

#include <algorithm>

#include "core/base/earliest.h"
#include "interneuron/sizes.h"

namespace interneuron::plan {
Duration compute_budget(Duration deadline, std::span<const LinkState> links,
                        std::size_t best_variant_bytes, std::size_t result_bytes) {
  Duration best = Duration::max();
  for (const LinkState& link : links) {
    if (!link.up || link.rate.bits_per_second <= 0 || link.rtt_p50 <= Duration::zero()) continue;
    const Duration transfer =
        link.usable_rate().transmit_time(wire_size(best_variant_bytes + result_bytes));
    best = std::min(best, std::min<Duration>(transfer, std::chrono::hours(1)) + link.rtt_p50);
  }
  if (best == Duration::max()) return Duration::zero();
  return std::max(Duration::zero(), deadline - best - kComputeReserve);
}

Duration soonest_way(std::span<const LinkState> links) {
  std::optional<Duration> best;
  for (const LinkState& link : links) {
    if (!link.up || link.rtt_min <= Duration::zero()) continue;
    best = earliest(best, link.rtt_min / 2 + link.queue_up);
  }
  return std::min<Duration>(best.value_or(Duration::zero()), std::chrono::hours(1));
}

std::array<std::optional<Duration>, kMaxVariants> forecast_answers(
    const Plan& plan, const Offer& offer, std::span<const LinkState> links) {
  const auto is_measured = [](const LinkState& link) {
    return link.up && link.rate.bits_per_second > 0 && link.rtt_p50 > Duration::zero();
  };
  std::optional<Duration> back;
  for (const LinkState& link : links) {
    if (!is_measured(link)) continue;
    const Duration way = link.rtt_min / 2 + link.queue_down;
    back = earliest(back, way);
  }
  std::array<std::optional<Duration>, kMaxVariants> out{};
  if (!back) return out;
  for (const LinkState& link : links) {
    if (!is_measured(link)) continue;
    // What leaves on this link up to and with the variant looked at: better variants leave first.
    std::size_t bytes = 0;
    for (std::size_t v = 0; v < offer.variant_bytes.size() && v < out.size(); ++v) {
      const bool here = std::ranges::any_of(plan.sends, [&](const Assignment& a) {
        return a.variant == v && a.link == link.id &&
               (a.role == SendRole::kWhole || a.role == SendRole::kShare);
      });
      if (!here) continue;
      bytes += wire_size(offer.variant_bytes[v]);
      Duration there =
          link.queue_up + link.rtt_min / 2 +
          std::min<Duration>(link.usable_rate().transmit_time(bytes), std::chrono::hours(1));
      if (v < offer.costs.size()) there += offer.costs[v].here + offer.costs[v].there;
      out[v] = earliest(out[v], there + *back);
    }
  }
  return out;
}

}  // namespace interneuron::plan
