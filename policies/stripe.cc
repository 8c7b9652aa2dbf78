// stripe: the best variant divided among all links that make it sooner, so that the last part of it
// is there as soon as can be ("DEMS: Decoupled and Efficient Multipath Scheduling", MobiCom 2017).
//
// Sender: each link that is up and neither a backup nor metered gets a share; the sender decides
// how large, and gives nothing to a link that would only add risk. So one link alone carries what
// it brings in time surely enough, and a link that has nothing to send takes over what another one
// is too slow for. Repair symbols may go over any of them. Where the operator's roles leave no
// link, as best_link.
//
//   some link            shares of the best variant; degraded: of the smallest
//   none                 whole over the fastest
//
// Receiver: every message is delivered at once.

#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

class Stripe final : public Policy {
 public:
  std::string_view name() const override { return "stripe"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const std::uint8_t variant = best_variant(offer, guidance);
    Plan plan;
    for (const LinkState& link : fastest(links, {}, kAllLinks)) {
      const bool helps = link.traits.role == LinkRole::kNormal && !link.traits.metered;
      if (helps) plan.sends.push_back({variant, link.id, SendRole::kShare});
    }
    if (plan.sends.empty()) plan = over_fastest(offer, links, variant, 1);
    report_floor(plan, offer, links);
    add_shadows(plan, offer, links);
    add_parity(plan, links);
    return plan;
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

}  // namespace

std::shared_ptr<const Policy> stripe() { return std::make_shared<Stripe>(); }

}  // namespace interneuron::policies
