// shadow: all of the best variant over the link that brings it soonest, and in its shadow, only
// when that link seems to fail it, a smaller variant over the next one.
//
// Sender: as best_link. At the last moment at which that helps, and only if the message is likely
// to be late, the second soonest link gets what is missing of it or, where there is no time for
// that, the next smaller variant. So a link that fails costs quality for a message or two, and a
// link that does not costs nothing.
//
// Receiver: a smaller variant that comes first is held for the better one until the stage deadline.
#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

class Shadow final : public Policy {
 public:
  std::string_view name() const override { return "shadow"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const std::uint8_t variant = best_variant(offer, guidance);
    Plan plan = over_fastest(offer, links, variant, 1);
    add_shadows(plan, offer, links);
    return plan;
  }

  Merge merge(const Arrival& arrival) const override { return hold_for_better(arrival); }
};

}  // namespace

std::shared_ptr<const Policy> shadow() { return std::make_shared<Shadow>(); }

}  // namespace interneuron::policies
