// progressive: little first, more where it is asked for (DDS: "Server-Driven Video Streaming for
// Deep Neural Network Inference", SIGCOMM 2020).
//
// For rounds of seven stages: uplink of a small picture, detection, request for the regions that
// are in doubt, cutting them out, uplink of these regions, detection, result. The first
// transmission is the smallest variant, so that a first result is there early; the time that is
// then left pays for quality.
//
//                        normal                                  degraded
//   first data           smallest over the fastest link          the same
//                        that carries it, else over the
//                        fastest, reported
//   later data           the best variant that is back in        smallest, if it is
//     (regions)          time, over the second fastest link      back in time, likewise
//                        that carries it, so that the next
//                        round's first transmission is not in
//                        its way; one link: over that
//     none is in time    nothing (kNoTimeLeft)                   the same
//   results              whole over the fastest that carries     smallest, likewise
//                        it, else over the fastest, reported
//
// "Reported": the plan says that it is under the floor. "Back in time": sent, computed on at the
// lowest level and answered within Guidance::time_left, as far as links and levels are measured;
// while the time left is not known, always. When regions are refused, the application keeps the
// first result: hand it to local_result() when the request comes.
//
// Receiver: whatever comes is delivered at once.
#include "policies/builtin.h"
#include "policies/choice.h"
#include "policies/offload.h"

namespace interneuron::policies {
namespace {

class Progressive final : public Policy {
 public:
  std::string_view name() const override { return "progressive"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const std::uint8_t smallest = smallest_variant(offer);
    if (offer.qos.message_class == MessageClass::kResult) {
      return over_fastest(offer, links, best_variant(offer, guidance), 1);
    }
    if (offer.earlier_communications == 0) return over_fastest(offer, links, smallest, 1);
    return regions(offer, links, guidance);
  }

  Merge merge(const Arrival&) const override { return Merge::kDeliver; }

 private:
  // Data of a round that has had a communication before: the regions that were asked for.
  static Plan regions(const Offer& offer, std::span<const LinkState> links,
                      const Guidance& guidance) {
    const Duration compute =
        guidance.levels.empty() ? Duration::zero() : guidance.levels.front().median;
    bool any_up = false;
    for (std::uint8_t variant = best_variant(offer, guidance); variant < offer.variant_bytes.size();
         ++variant) {
      const std::size_t bytes = offer.variant_bytes[variant];
      const Links pair = fastest(links, rate_floor(offer.qos, bytes), 2);
      if (pair.empty()) continue;
      any_up = true;
      const LinkState& other = pair.back();
      if (in_time(guidance.time_left, round_time(other, bytes, compute))) {
        return send_over({&other, 1}, variant);
      }
    }
    any_up = any_up || !fastest(links, {}, 1).empty();
    Plan nothing;
    if (any_up) nothing.refused = kNoTimeLeft;
    return nothing;
  }
};

}  // namespace

std::shared_ptr<const Policy> progressive() { return std::make_shared<Progressive>(); }

}  // namespace interneuron::policies
