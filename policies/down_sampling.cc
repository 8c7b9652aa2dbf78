// down_sampling: the paper's example (docs/paper.md, "Down-sampling"). It needs delay: raw over one
// of the two fastest links that can carry it, a sampled copy over the other in case raw is late.
//
// "raw" is the best variant that is to be sent (Guidance), "sampled" the next one. A link is fit
// for a variant when it meets its rate floor.
//
// The two links: the one with the best delay of those fit for raw, and the one with the best delay
// of the others that are fit for sampled. (Were both to be fit for raw, a 4G link that cannot carry
// raw at the frame rate would leave one link and no sampled copy.)
//
//                         normal                              degraded
//   two links             raw over the one with more          sampled over both
//                         bandwidth, sampled over the other
//   one link,             raw                                 sampled
//     fit for raw
//   none fit for raw      sampled over the fastest link       sampled over the two fastest links
//                         fit for it, reported                fit for it
//   none fit for sampled  sampled over the fastest, reported  sampled over the fastest, reported
//   no smaller variant    whole over the fastest fit for it   whole over the two fastest fit for it
//     none fit for it     whole over the fastest, reported    whole over the fastest, reported
//
// "Reported": the plan says that it is under the floor (Plan::under_floor). Degraded, where the
// guard names a variant, that one is "sampled".
//
// What could not be sent again in time if it was lost is covered by repair symbols of the best
// variant that is sent, over either link. When raw seems late, what is missing of it goes over the
// other link at the last moment at which that helps.
//
// Receiver: raw, or anything degraded, is delivered at once. Sampled is held until the stage
// deadline if raw was sent too.
#include <algorithm>

#include "policies/builtin.h"
#include "policies/choice.h"

namespace interneuron::policies {
namespace {

// Links.
constexpr std::size_t kBoth = 2;

// The variant over the fastest link although none is fit for it.
Plan best_effort(const Offer& offer, std::span<const LinkState> links, std::uint8_t variant) {
  Plan plan = over_fastest(offer, links, variant, 1);
  plan.under_floor = !plan.sends.empty();
  return plan;
}

// The link for raw, which is fit for it, and the one for the sampled copy, or as many of them as
// there are.
Links raw_and_sampled_link(std::span<const LinkState> links, DataRate raw_floor,
                           DataRate sampled_floor) {
  Links pair = fastest(links, raw_floor, 1);
  if (pair.empty()) return pair;
  for (const LinkState& link : fastest(links, sampled_floor, kBoth)) {
    if (link.id != pair.front().id && pair.size() < kBoth) pair.push_back(link);
  }
  if (pair.size() < kBoth) return pair;
  // A rate not measured yet is 0: it meets every floor, but a measured one is preferred.
  const bool second_is_fit = !fastest(std::span(pair).last(1), raw_floor, 1).empty();
  if (second_is_fit && pair[1].rate > pair[0].rate) std::swap(pair[0], pair[1]);
  return pair;
}

class DownSampling final : public Policy {
 public:
  std::string_view name() const override { return "down_sampling"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    Plan plan = copies(offer, links, guidance);
    add_parity(plan, links);
    return plan;
  }

  Merge merge(const Arrival& arrival) const override { return hold_for_better(arrival); }

 private:
  static Plan copies(const Offer& offer, std::span<const LinkState> links,
                     const Guidance& guidance) {
    const std::uint8_t smallest = smallest_variant(offer);
    if (smallest == 0) return whole(offer, links, guidance.degraded);
    const std::uint8_t raw = std::min<std::uint8_t>(guidance.variant.value_or(0), smallest - 1);
    const std::uint8_t degraded = std::min(guidance.variant.value_or(1), smallest);
    const auto sampled = static_cast<std::uint8_t>(guidance.degraded ? degraded : raw + 1);
    const DataRate raw_floor = rate_floor(offer.qos, offer.variant_bytes[raw]);
    const DataRate sampled_floor = rate_floor(offer.qos, offer.variant_bytes[sampled]);

    Links pair = raw_and_sampled_link(links, raw_floor, sampled_floor);
    if (guidance.degraded) {
      if (pair.empty()) pair = fastest(links, sampled_floor, kBoth);
      if (pair.empty()) return best_effort(offer, links, sampled);
      return send_over(pair, sampled);
    }
    if (pair.empty()) return best_effort(offer, links, sampled);
    Plan plan;
    plan.sends.push_back({raw, pair.front().id});
    if (pair.size() == kBoth) {
      plan.sends.push_back({sampled, pair.back().id});
      plan.sends.push_back({raw, pair.back().id, SendRole::kShadow});
    }
    return plan;
  }

  // A message that has no smaller variant.
  static Plan whole(const Offer& offer, std::span<const LinkState> links, bool degraded) {
    const DataRate floor = rate_floor(offer.qos, offer.variant_bytes.front());
    const Links carriers = fastest(links, floor, degraded ? kBoth : 1);
    return carriers.empty() ? best_effort(offer, links, 0) : send_over(carriers, 0);
  }
};

}  // namespace

std::shared_ptr<const Policy> down_sampling() { return std::make_shared<DownSampling>(); }

}  // namespace interneuron::policies
