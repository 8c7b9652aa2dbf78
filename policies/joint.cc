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
//   named                    as above, of that variant alone
//   nothing in time, or no   the smallest (named: that one, or the next that a link carries) over
//     link is measured       the link that brings it soonest; where none carries it over the
//                            fastest, reported as under the floor
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

// What is sent where nothing is in time: the variant that the guard names, or the next one that a
// link carries at the rate of frames; the smallest where it names none.
Plan best_carried(const Offer& offer, std::span<const LinkState> links, const Guidance& guidance) {
  const std::uint8_t smallest = smallest_variant(offer);
  std::uint8_t variant = guidance.variant ? best_variant(offer, guidance) : smallest;
  Plan plan = over_fastest(offer, links, variant, 1);
  while (plan.under_floor && variant < smallest) plan = over_fastest(offer, links, ++variant, 1);
  return plan;
}

class Joint final : public Policy {
 public:
  std::string_view name() const override { return "joint"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const auto best = best_offload(offer, links, guidance);
    Plan plan =
        best ? send_over({&best->link, 1}, best->variant) : best_carried(offer, links, guidance);
    insure(plan, offer, links);
    add_parity(plan, links);
    return plan;
  }

  Merge merge(const Arrival& arrival) const override { return hold_for_better(arrival); }
};

}  // namespace

std::shared_ptr<const Policy> joint() { return std::make_shared<Joint>(); }

}  // namespace interneuron::policies
