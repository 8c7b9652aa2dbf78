// What the built-in policies share: which links are fastest, and what is sent over them. Written
// against the public headers alone, so that a policy of your own may copy what it needs. "Under the
// floor" means that no link can carry the variant in time and the plan is best effort
// (Plan::under_floor). Pure; allocates nothing.
#pragma once

#include <limits>

#include "interneuron/policy.h"
#include "interneuron/requirement.h"

namespace interneuron::policies {

inline constexpr std::size_t kAllLinks = std::numeric_limits<std::size_t>::max();

// At most `count` of the links that are up and whose rate is at least `floor`, best delay first.
Links fastest(std::span<const LinkState> links, DataRate floor, std::size_t count);

// At most `count` of the same links, soonest arrival of `bytes` first among those of equal
// priority. A link on which that is not measured comes last, in the order of fastest().
Links soonest(std::span<const LinkState> links, DataRate floor, std::size_t count,
              std::size_t bytes);

// At most `count` of the links that may be used, those with the least `cost` (a Duration) first
// among those of equal priority.
template <class Cost>
Links ranked(std::span<const LinkState> links, std::size_t count, const Cost& cost) {
  Links order;
  // By insertion, which keeps the order of equals.
  for (const LinkState& link : fastest(links, {}, kAllLinks)) {
    std::size_t at = order.size();
    while (at > 0 && order[at - 1].traits.priority == link.traits.priority &&
           cost(link) < cost(order[at - 1])) {
      --at;
    }
    order.insert(at, link);
  }
  Links out;
  for (const LinkState& link : order) {
    if (out.size() < count) out.push_back(link);
  }
  return out;
}

// The same by the median round trip; a link on which that is not measured comes last.
Links smallest_round_trips(std::span<const LinkState> links, std::size_t count);

// Lets a plan's best variant, and the one after it, stand by (SendRole::kShadow) over the soonest
// of the links that do not carry it. A metered link or a backup is not used for that.
void add_shadows(Plan& plan, const Offer& offer, std::span<const LinkState> links);

// Lets every link that may be used carry repair symbols of the plan's best variant. A metered link
// or a backup does so only if it carries the variant.
void add_parity(Plan& plan, std::span<const LinkState> links);

// Says of a plan of one variant that it is under the floor where none of the links that carry all
// of it, and the shares together not, meet the variant's rate floor, as far as they are measured.
void report_floor(Plan& plan, const Offer& offer, std::span<const LinkState> links);

// One variant over each of these links.
Plan send_over(std::span<const LinkState> over, std::uint8_t variant);

// One variant over at most `count` of the links that bring it soonest of those that meet its rate
// floor; where none does, over the fastest all the same, and the plan says that it is under the
// floor.
Plan over_fastest(const Offer& offer, std::span<const LinkState> links, std::uint8_t variant,
                  std::size_t count);

// The index of the last variant of an offer, which has at least one.
std::uint8_t smallest_variant(const Offer& offer);

// The best variant that is to be sent, as the guard says; where it does not, the best there is.
std::uint8_t best_variant(const Offer& offer, const Guidance& guidance);

// Holds a variant while a better one was planned too, unless the message was sent degraded.
Merge hold_for_better(const Arrival& arrival);

}  // namespace interneuron::policies
