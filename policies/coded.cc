// coded: all of the best variant over the link that brings it soonest, and what losses could cost
// it is covered by repair symbols ("Hairpin: Rethinking Packet Loss Recovery in Edge-based
// Interactive Video Streaming", NSDI 2024, decides alike how many).
//
// Sender: as best_link; every link that is up may carry symbols, and the sender prefers one that
// does not carry the message, since what loses pieces loses symbols beside them. What is lost early
// enough is sent again without any symbols. When the message seems late, what is missing goes over
// the second soonest link, or a smaller variant does; while that link is idle, it also takes pieces
// of a plain message that leaves the first one little time to spare.
//
//                        normal                          degraded
//   some link fit for it whole over the soonest          smallest variant, likewise
//   none                 whole over the fastest,         smallest variant, likewise
//                        reported as under the floor
//
// Receiver: a smaller variant that comes first is held for the better one until the stage deadline.
#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

class Coded final : public Policy {
 public:
  std::string_view name() const override { return "coded"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const std::uint8_t variant = best_variant(offer, guidance);
    Plan plan = over_fastest(offer, links, variant, 1);
    add_shadows(plan, offer, links);
    add_parity(plan, links);
    return plan;
  }

  Merge merge(const Arrival& arrival) const override { return hold_for_better(arrival); }
};

}  // namespace

std::shared_ptr<const Policy> coded() { return std::make_shared<Coded>(); }

}  // namespace interneuron::policies
