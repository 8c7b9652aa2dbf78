// duplicate: the same over every link that can carry it; the first copy wins.
//
// Sender: the best variant, when degraded the smallest, over all links that meet its rate floor;
// when none does, over all that are up, reported. Receiver: the first copy is delivered at once.
#include "interneuron/requirement.h"
#include "policies/builtin.h"

namespace interneuron::policies {
namespace {

class Duplicate final : public Policy {
 public:
  std::string_view name() const override { return "duplicate"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const std::size_t variant = guidance.degraded ? offer.variant_bytes.size() - 1 : 0;
    Requirement wide_enough{.min_rate = rate_floor(offer.qos, offer.variant_bytes[variant]),
                            .weights = {.delay = 1}};
    Plan plan;
    std::vector<LinkState> chosen = match(wide_enough, links);
    if (chosen.empty()) {
      wide_enough.min_rate = {};
      chosen = match(wide_enough, links);
      plan.under_floor = !chosen.empty();
    }
    for (const LinkState& link : chosen) {
      plan.sends.push_back({static_cast<std::uint8_t>(variant), link.id});
    }
    return plan;
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

}  // namespace

std::shared_ptr<const Policy> duplicate() { return std::make_shared<Duplicate>(); }

}  // namespace interneuron::policies
