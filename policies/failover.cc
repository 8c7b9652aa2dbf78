// failover: everything over one link as long as it works, and what is missing over the next when it
// does not; the rule of bonded links with a main and a backup (SRT's main/backup mode).
//
// Sender: the main link is the one of the highest priority and, among equals, of the best delay;
// the rate does not matter. When a message is likely to be late over it, what is missing of the
// message goes over the next link. No smaller variant is ever sent but when the message is
// degraded.
//
// Receiver: every message is delivered at once.
#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

class Failover final : public Policy {
 public:
  std::string_view name() const override { return "failover"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const std::uint8_t variant = best_variant(offer, guidance);
    const Links pair = fastest(links, {}, 2);
    if (pair.empty()) return {};
    Plan plan = send_over({&pair[0], 1}, variant);
    report_floor(plan, offer, links);
    if (pair.size() > 1) plan.sends.push_back({variant, pair[1].id, SendRole::kShadow});
    return plan;
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

}  // namespace

std::shared_ptr<const Policy> failover() { return std::make_shared<Failover>(); }

}  // namespace interneuron::policies
