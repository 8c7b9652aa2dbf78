#include "interneuron/requirement.h"

#include <algorithm>

#include "interneuron/policy.h"
#include "plan/wire_size.h"

namespace interneuron {
namespace {

bool meets(const Requirement& r, const LinkState& link) {
  const bool delay_measured = link.rtt_p95 > Duration::zero();
  const bool rate_measured = link.rate > DataRate{};
  return !(delay_measured && link.rtt_p95 > r.max_rtt) &&
         !(rate_measured && link.rate < r.min_rate) && !(link.loss > r.max_loss) &&
         !(link.nature.security < r.min_security);
}

// NOTES §2: rank by weighted score. What is not a number ranks last, so that the order stays total.
double rank(const Nature& weights, const Nature& score) {
  const double sum = weights.delay * score.delay + weights.bandwidth * score.bandwidth +
                     weights.reliability * score.reliability + weights.security * score.security;
  return sum == sum ? sum : -std::numeric_limits<double>::infinity();
}

}  // namespace

std::vector<LinkState> match(const Requirement& requirement, std::span<const LinkState> links) {
  std::vector<LinkState> out;
  const auto take = [&](LinkRole role) {
    for (const LinkState& link : links) {
      if (link.up && link.traits.role == role && meets(requirement, link)) out.push_back(link);
    }
  };
  take(LinkRole::kNormal);
  if (out.empty()) take(LinkRole::kBackup);
  std::ranges::stable_sort(out, [&requirement](const LinkState& a, const LinkState& b) {
    if (a.traits.priority != b.traits.priority) return a.traits.priority < b.traits.priority;
    return rank(requirement.weights, a.nature) > rank(requirement.weights, b.nature);
  });
  if (out.size() > requirement.links) out.resize(requirement.links);
  return out;
}

DataRate rate_floor(const QoS& qos, std::size_t bytes) {
  return rate_of(bytes, qos.period > Duration::zero() ? qos.period : qos.deadline);
}

Duration arrival_time(const LinkState& link, std::size_t bytes) {
  const bool measured = link.rtt_p95 > Duration::zero() && link.rate > DataRate{};
  if (!measured) return Duration::max();
  // Bounded, so that sums of such times stay representable.
  return link.rtt_p95 / 2 +
         std::min<Duration>(link.rate.transmit_time(wire_size(bytes)), std::chrono::hours(1));
}

}  // namespace interneuron
