// joint: one choice over data and model together ("Joint Model and Data Adaptation for Cloud
// Inference Serving", Jiang et al. 2021), instead of two knobs turned one after the other.
//
// Sender: the variant that the guard names, over the link that brings it soonest. Where it names
// none (Guidance::variant), of all (variant, link, level) whose answer is back in
// Guidance::time_left, as links and levels are measured, the one with the highest expected quality;
// of equals the soonest. The level is the guard's to choose when the input has arrived; here it
// tells what the variant is worth.
//
//   levels and time known    the variant and link of the best (variant, link, level) in time
//   levels not known         the best variant in time, over the link where it is soonest
//   nothing in time, or no   the smallest (the one named) over the fastest link that carries it,
//     link is measured       else over the fastest, reported as under the floor
//   named, or degraded       as above, of that variant alone
//
// Beside it the smallest variant goes over the fastest other link that can carry it, as an
// insurance against a late or lost first one. A metered link is not used for that, and a plan under
// the floor gets no insurance, because no link has room for it. What of the best variant that is
// sent could not be sent again in time if it was lost is covered by repair symbols, over any link.
//
// Receiver: holds what is not the best that was planned until the stage deadline.
#include <algorithm>

#include "policies/builtin.h"
#include "policies/choice.h"
#include "policies/offload.h"

namespace interneuron::policies {
namespace {

// Adds the insurance to a plan that has one transmission.
void insure(Plan& plan, const Offer& offer, std::span<const LinkState> links) {
  if (plan.sends.empty() || plan.under_floor) return;
  const std::uint8_t smallest = smallest_variant(offer);
  const DataRate floor = rate_floor(offer.qos, offer.variant_bytes[smallest]);
  const Links able = fastest(links, floor, kAllLinks);
  const auto other = std::ranges::find_if(able, [&plan](const LinkState& link) {
    return link.id != plan.sends.front().link && !link.traits.metered;
  });
  if (other != able.end()) plan.sends.push_back({smallest, other->id});
}

class Joint final : public Policy {
 public:
  std::string_view name() const override { return "joint"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const auto best = best_offload(offer, links, guidance);
    const std::uint8_t otherwise =
        guidance.variant ? best_variant(offer, guidance) : smallest_variant(offer);
    Plan plan = best ? send_over({&best->link, 1}, best->variant)
                     : over_fastest(offer, links, otherwise, 1);
    insure(plan, offer, links);
    add_parity(plan, links);
    return plan;
  }

  Merge merge(const Arrival& arrival) const override { return hold_for_better(arrival); }
};

}  // namespace

std::shared_ptr<const Policy> joint() { return std::make_shared<Joint>(); }

}  // namespace interneuron::policies
