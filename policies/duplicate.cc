// duplicate: the same over every link that can carry it; the first copy wins.
//
// Sender: the best variant, when degraded the smallest, over all links that meet its rate floor;
// when none does, over all that are up, reported. Receiver: the first copy is delivered at once.
#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

class Duplicate final : public Policy {
 public:
  std::string_view name() const override { return "duplicate"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    return over_fastest(offer, links, guidance.degraded ? smallest_variant(offer) : 0, kAllLinks);
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

}  // namespace

std::shared_ptr<const Policy> duplicate() { return std::make_shared<Duplicate>(); }

}  // namespace interneuron::policies
