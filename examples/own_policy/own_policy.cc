// A policy of one's own in one file: patient keeps to the link with the best delay until another
// one is clearly better for this message, by half; so it switches seldom. Prints what it plans.
#include <interneuron/policy.h>
#include <interneuron/requirement.h>

#include <algorithm>
#include <cstdio>
#include <memory>

namespace in = interneuron;

class Patient final : public in::Policy {
 public:
  std::string_view name() const override { return "patient"; }

  in::Plan plan(const in::Offer& offer, std::span<const in::LinkState> links,
                const in::Guidance& guidance) const override {
    const std::size_t smallest = offer.variant_bytes.size() - 1;
    const std::size_t named = std::min<std::size_t>(guidance.variant.value_or(0), smallest);
    const std::size_t variant = guidance.degraded ? smallest : named;
    const std::size_t bytes = offer.variant_bytes[variant];
    in::Plan plan;
    const in::LinkState* chosen = nullptr;
    const auto ranked = match({.weights = {.delay = 1}}, links);
    for (const in::LinkState& link : ranked) {
      if (chosen == nullptr || arrival_time(link, bytes) < arrival_time(*chosen, bytes) / 2) {
        chosen = &link;
      }
    }
    if (chosen == nullptr) return plan;  // no link is up
    plan.sends.push_back({static_cast<std::uint8_t>(variant), chosen->id});
    plan.under_floor = chosen->rate < rate_floor(offer.qos, bytes);
    return plan;
  }

  in::Merge merge(const in::Arrival&) const override { return in::Merge::kDeliver; }
};

in::LinkState link(std::uint8_t id, double mbit, int rtt_ms, double delay_score) {
  in::LinkState state{.id = {id},
                      .up = true,
                      .rtt_p95 = std::chrono::milliseconds(rtt_ms),
                      .rate = in::DataRate::mbit(mbit)};
  state.nature.delay = delay_score;
  return state;
}

int main() {
  // How a node would use it: NodeOptions::policies, at both ends.
  in::PolicySet policies = in::builtin_policies();
  policies.push_back(std::make_shared<const Patient>());

  const std::size_t sizes[] = {512 * 1024, 128 * 1024};
  const in::Offer offer{
      {.deadline = std::chrono::milliseconds(130), .period = std::chrono::milliseconds(100)},
      sizes};
  const in::LinkState links[] = {link(1, 50, 20, 1.0), link(2, 60, 25, 0.8), link(3, 400, 30, 0.6)};
  for (const auto& policy : policies) {
    std::printf("%-14s", std::string(policy->name()).c_str());
    const in::Plan plan = policy->plan(offer, links, {});
    for (const in::Assignment& send : plan.sends) {
      std::printf(" variant %d over link %d;", send.variant, send.link.value);
    }
    std::printf("%s\n", std::string(plan.refused).c_str());
  }
}
