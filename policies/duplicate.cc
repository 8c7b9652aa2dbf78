// duplicate: the same variant over every link that can carry it; the first copy wins.
//
// Sender: the best variant, or the smallest when the message is degraded, over all links that meet
// its rate floor. Where none does, it goes over all links that are up, and the plan says that it is
// under the floor. Receiver: the first copy is delivered at once.
#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

class Duplicate final : public Policy {
 public:
  std::string_view name() const override { return "duplicate"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    return over_fastest(offer, links, best_variant(offer, guidance), kAllLinks);
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

}  // namespace

std::shared_ptr<const Policy> duplicate() { return std::make_shared<Duplicate>(); }

}  // namespace interneuron::policies
