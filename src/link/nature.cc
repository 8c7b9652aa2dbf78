#include "link/nature.h"

#include <algorithm>
#include <optional>

namespace interneuron::link {
namespace {

using Measure = std::optional<double> (*)(const LinkState&);

std::optional<double> delay_ns(const LinkState& link) {
  if (link.rtt_p95 <= Duration::zero()) return std::nullopt;
  return static_cast<double>(link.rtt_p95.count()) / 2;
}

std::optional<double> rate_bps(const LinkState& link) {
  if (link.rate <= DataRate{}) return std::nullopt;
  return static_cast<double>(link.rate.bits_per_second);
}

std::optional<double> floored_loss(const LinkState& link) {
  if (link.rtt_p95 <= Duration::zero()) return std::nullopt;
  return std::max(kLossFloor, link.loss);
}

enum class Better { kSmaller, kLarger };

void score_field(std::span<LinkState> links, double Nature::*field, Measure measure,
                 Better better) {
  std::optional<double> smallest;
  std::optional<double> largest;
  for (const LinkState& link : links) {
    const auto value = link.up ? measure(link) : std::nullopt;
    if (!value) continue;
    smallest = std::min(*value, smallest.value_or(*value));
    largest = std::max(*value, largest.value_or(*value));
  }
  const double unmeasured = smallest ? kUnmeasured * (*smallest / *largest) : 1.0;
  for (LinkState& link : links) {
    const auto value = link.up ? measure(link) : std::nullopt;
    double& score = link.nature.*field;
    if (value) {
      score = better == Better::kSmaller ? *smallest / *value : *value / *largest;
    } else {
      score = link.up ? unmeasured : 0.0;
    }
  }
}

}  // namespace

void score(std::span<LinkState> links) {
  score_field(links, &Nature::delay, delay_ns, Better::kSmaller);
  score_field(links, &Nature::bandwidth, rate_bps, Better::kLarger);
  score_field(links, &Nature::reliability, floored_loss, Better::kSmaller);
  for (LinkState& link : links) link.nature.security = 0;
}

}  // namespace interneuron::link
