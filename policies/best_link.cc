// best_link: everything over one link, the one that brings it soonest of those that can carry it.
//
// Sender: the best variant, or the smallest when the message is degraded. A large message may be
// there sooner over a link of more delay and more rate. Where no link meets the variant's rate
// floor, it goes over the link with the best delay all the same, and the plan says that it is under
// the floor. Receiver: every message is delivered at once.
#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

class BestLink final : public Policy {
 public:
  std::string_view name() const override { return "best_link"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    return over_fastest(offer, links, best_variant(offer, guidance), 1);
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

}  // namespace

std::shared_ptr<const Policy> best_link() { return std::make_shared<BestLink>(); }

}  // namespace interneuron::policies
