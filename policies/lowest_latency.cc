// lowest_latency: everything over the link of the lowest latency now, queues included, and what is
// missing over the next one when that link turns unstable: how SRT chooses among members of a
// backup group that have equal weights. For comparisons.
//
// Sender: of the links of the highest priority that are up, the one with the smallest expected way
// (half the median round trip and the queue towards the peer); the next one stands by with the same
// variant. Rate and size of the message do not matter, which is what best_link adds.
//
// Receiver: every message is delivered at once.
#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

class LowestLatency final : public Policy {
 public:
  std::string_view name() const override { return "lowest_latency"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const std::uint8_t variant = best_variant(offer, guidance);
    const Links pair = ranked(links, 2, [](const LinkState& link) {
      return link.rtt_p50 == Duration::zero() ? Duration::max() : link.rtt_p50 / 2 + link.queue_up;
    });
    if (pair.empty()) return {};
    Plan plan = send_over({&pair[0], 1}, variant);
    report_floor(plan, offer, links);
    if (pair.size() > 1) plan.sends.push_back({variant, pair[1].id, SendRole::kShadow});
    return plan;
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

}  // namespace

std::shared_ptr<const Policy> lowest_latency() { return std::make_shared<LowestLatency>(); }

}  // namespace interneuron::policies
