// The arithmetic that policies are written with: which links meet a requirement, what rate a
// message needs, when it would be there (requirement.h and policy.h in include/interneuron).
#include "interneuron/requirement.h"

#include <algorithm>

#include "interneuron/policy.h"
#include "interneuron/sizes.h"

namespace interneuron {
namespace {

bool meets(const Requirement& r, const LinkState& link) {
  const bool delay_measured = link.rtt_p95 > Duration::zero();
  const bool rate_measured = link.rate > DataRate{};
  return !(delay_measured && link.rtt_p95 > r.max_rtt) &&
         !(rate_measured && link.usable_rate() < r.min_rate) && !(link.loss > r.max_loss) &&
         !(link.nature.security < r.min_security);
}

// Links are ranked by their weighted score (docs/paper.md, "Requirement table"). What is not a
// number ranks last, so that the order stays total.
double rank(const Nature& weights, const Nature& score) {
  const double sum = weights.delay * score.delay + weights.bandwidth * score.bandwidth +
                     weights.reliability * score.reliability + weights.security * score.security;
  return sum == sum ? sum : -std::numeric_limits<double>::infinity();
}

struct Candidate {
  const LinkState* link = nullptr;
  double rank = 0;
};

bool is_better(const Candidate& a, const Candidate& b) {
  const int p = a.link->traits.priority;
  const int q = b.link->traits.priority;
  return p != q ? p < q : a.rank > b.rank;
}

}  // namespace

Links match(const Requirement& requirement, std::span<const LinkState> links) {
  // Best first.
  Few<Candidate, kMaxLinks> ranked;
  const auto take = [&](LinkRole role) {
    for (const LinkState& link : links) {
      if (!link.up || link.traits.role != role || !meets(requirement, link)) continue;
      const Candidate candidate{&link, rank(requirement.weights, link.nature)};
      std::size_t at = ranked.size();
      while (at > 0 && is_better(candidate, ranked[at - 1])) --at;
      ranked.insert(at, candidate);
    }
  };
  take(LinkRole::kNormal);
  if (ranked.empty()) take(LinkRole::kBackup);
  Links out;
  for (const Candidate& c : ranked) {
    if (out.size() < requirement.links) out.push_back(*c.link);
  }
  return out;
}

DataRate rate_floor(const QoS& qos, std::size_t bytes) {
  return rate_of(bytes, qos.period > Duration::zero() ? qos.period : qos.deadline);
}

Duration arrival_time(const LinkState& link, std::size_t bytes) {
  const bool measured = link.rtt_p95 > Duration::zero() && link.rate > DataRate{};
  if (!measured) return Duration::max();
  // Bounded, so that sums of such times stay representable.
  return link.rtt_p95 / 2 + std::min<Duration>(link.usable_rate().transmit_time(wire_size(bytes)),
                                               std::chrono::hours(1));
}

}  // namespace interneuron
