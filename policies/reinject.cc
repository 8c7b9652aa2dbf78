// reinject: a message over the link with the smallest round trip, and what is not acknowledged in
// time once more over the other ("XLINK: QoE-Driven Multi-Path QUIC Transport in Large-scale Video
// Services", SIGCOMM 2021), with the deadline in place of the player's buffer. For comparisons.
//
// Sender: as min_rtt; the link with the next larger round trip stands by with the same variant.
//
// Receiver: every message is delivered at once.
#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

class Reinject final : public Policy {
 public:
  std::string_view name() const override { return "reinject"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const std::uint8_t variant = best_variant(offer, guidance);
    const Links pair = smallest_round_trips(links, 2);
    if (pair.empty()) return {};
    Plan plan = send_over({&pair[0], 1}, variant);
    report_floor(plan, offer, links);
    if (pair.size() > 1) plan.sends.push_back({variant, pair[1].id, SendRole::kShadow});
    return plan;
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

}  // namespace

std::shared_ptr<const Policy> reinject() { return std::make_shared<Reinject>(); }

}  // namespace interneuron::policies
