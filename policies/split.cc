// split: where to cut a computation between here and there ("Neurosurgeon: Collaborative
// Intelligence Between the Cloud and Mobile Edge", ASPLOS 2017).
//
// The application registers its cut points as variants, the first one with everything done there,
// and tells their costs (Offer::costs): what is computed here before sending and there after. It
// asks Endpoint::preview() which one to take before it computes, and submits that one alone.
//
// Sender: of all (cut, link) the one with the least here + transmission + there + return.
//
//   links measured      the soonest over links that can carry it; if that is in time, so the round
//   none measured       the smallest over the fastest link that carries it, else over the fastest,
//                       reported as under the floor
//   without costs       the same, with all costs 0
//   degraded            the same: it is the soonest already
//
// Receiver: one cut is sent; delivered at once.
#include "policies/builtin.h"
#include "policies/choice.h"
#include "policies/offload.h"

namespace interneuron::policies {
namespace {

class Split final : public Policy {
 public:
  std::string_view name() const override { return "split"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links, const Guidance&) const override {
    Duration least = Duration::max();
    Plan plan;
    for (std::uint8_t cut = 0; cut < offer.variant_bytes.size(); ++cut) {
      const std::size_t bytes = offer.variant_bytes[cut];
      const VariantCost cost = cut < offer.costs.size() ? offer.costs[cut] : VariantCost{};
      for (const LinkState& link : fastest(links, rate_floor(offer.qos, bytes), kAllLinks)) {
        const Duration time = round_time(link, bytes, cost.here + cost.there);
        if (time >= least) continue;
        least = time;
        plan = send_over({&link, 1}, cut);
      }
    }
    return plan.sends.empty() ? over_fastest(offer, links, smallest_variant(offer), 1) : plan;
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

}  // namespace

std::shared_ptr<const Policy> split() { return std::make_shared<Split>(); }

}  // namespace interneuron::policies
