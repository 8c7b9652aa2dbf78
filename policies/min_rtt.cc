// min_rtt: everything over the link with the smallest round trip, the default scheduler of
// Multipath TCP ("Experimental evaluation of multipath TCP schedulers", Paasch et al., CSWS 2014),
// with whole messages in place of segments. For comparisons.
//
// Sender: of the links of the highest priority that are up, the one whose median round trip is
// smallest; one that is not measured comes last. Neither rate nor deadline matter.
//
// Receiver: every message is delivered at once.
#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

class MinRtt final : public Policy {
 public:
  std::string_view name() const override { return "min_rtt"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const std::uint8_t variant = best_variant(offer, guidance);
    const Links best = smallest_round_trips(links, 1);
    Plan plan = send_over(best, variant);
    report_floor(plan, offer, links);
    return plan;
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

}  // namespace

std::shared_ptr<const Policy> min_rtt() { return std::make_shared<MinRtt>(); }

}  // namespace interneuron::policies
