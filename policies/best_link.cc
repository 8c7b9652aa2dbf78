// best_link: everything over the one link with the best delay among those that can carry it.
//
// Sender: the best variant, when degraded the smallest. No link meets the variant's rate floor: the
// link with the best delay all the same, reported. Receiver: whatever comes is delivered at once.
#include "interneuron/requirement.h"
#include "policies/builtin.h"

namespace interneuron::policies {
namespace {

class BestLink final : public Policy {
 public:
  std::string_view name() const override { return "best_link"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const std::size_t variant = guidance.degraded ? offer.variant_bytes.size() - 1 : 0;
    Requirement fastest{.min_rate = rate_floor(offer.qos, offer.variant_bytes[variant]),
                        .weights = {.delay = 1},
                        .links = 1};
    Plan plan;
    std::vector<LinkState> chosen = match(fastest, links);
    if (chosen.empty()) {
      fastest.min_rate = {};
      chosen = match(fastest, links);
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

std::shared_ptr<const Policy> best_link() { return std::make_shared<BestLink>(); }

}  // namespace interneuron::policies
