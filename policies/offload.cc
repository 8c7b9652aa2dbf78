#include "policies/offload.h"

#include <algorithm>

#include "policies/choice.h"

namespace interneuron::policies {
namespace {

// A level that is in time: its expected quality and the time that it takes.
struct Affordable {
  double quality = 0;
  Duration time{};
};

// The best of them; nothing when none is in time. Before the levels are known a better variant
// stands for higher quality, and the computation is taken to need no time.
std::optional<Affordable> best_level(const LinkState& link, std::size_t bytes, std::size_t variant,
                                     const Guidance& guidance) {
  std::optional<Affordable> best;
  const auto consider = [&](double quality, Duration compute) {
    const Duration time = round_time(link, bytes, compute);
    if (time == Duration::max() || !in_time(guidance.time_left, time)) return;
    if (!best || quality > best->quality) best = {quality, time};
  };
  if (guidance.levels.empty()) consider(-static_cast<double>(variant), Duration::zero());
  for (const LevelProfile& level : guidance.levels) {
    const std::vector<double>& by_variant = level.quality;
    const double quality =
        by_variant.empty() ? 0 : by_variant[std::min(variant, by_variant.size() - 1)];
    consider(quality, level.median);
  }
  return best;
}

}  // namespace

Duration round_time(const LinkState& link, std::size_t bytes, Duration compute) {
  const Duration arrival = arrival_time(link, bytes);
  if (arrival == Duration::max()) return arrival;
  return arrival + compute + link.rtt_p95 / 2;
}

bool in_time(Duration time_left, Duration time) {
  if (time_left == Duration::max()) return true;
  return time != Duration::max() && time <= time_left - kOffloadReserve;
}

std::optional<Offload> best_offload(const Offer& offer, std::span<const LinkState> links,
                                    const Guidance& guidance) {
  std::optional<Offload> best;
  const std::uint8_t first = best_variant(offer, guidance);
  const std::uint8_t last = guidance.variant ? first : smallest_variant(offer);
  for (std::uint8_t variant = first; variant <= last; ++variant) {
    const std::size_t bytes = offer.variant_bytes[variant];
    for (const LinkState& link : fastest(links, rate_floor(offer.qos, bytes), kAllLinks)) {
      const auto way = best_level(link, bytes, variant, guidance);
      if (!way) continue;
      const bool better = !best || way->quality > best->quality ||
                          (way->quality == best->quality && way->time < best->time);
      if (better) best = Offload{variant, link, way->quality, way->time};
    }
  }
  return best;
}

}  // namespace interneuron::policies
