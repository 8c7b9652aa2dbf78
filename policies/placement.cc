// placement: offload or stay, round by round (Kayak: "Ship Compute or Ship Data? Why Not Both?",
// NSDI 2021).
//
// Sender: compares Guidance::local_quality with the best quality that is back in time, as `joint`
// weighs it, over each link; where the guard names a variant, with that one's. Where offloading
// promises more, sends as `joint`; else nothing, and the round is answered locally
// (kLocalIsBetter).
//
// A round that stays local measures nothing, and a link near its limit must not make the choice
// flap; a policy keeps no state, but the age of a link's evidence tells what was done lately:
//
//   newest evidence of the rate     a link is in time within
//   at most 2 periods old           time_left: it is in use, and stays so
//   older                           0.9 time_left: to come back, there must be room to spare
//   on all links older than its     nothing is known: offload, only sending can tell
//     confidence's half-life
//
// (A link not measured lately loses confidence; that in the rate halves within 42 s, see
// src/core/link/nature.h.) Results, and data while time, levels or local quality are not known, go
// as with `joint`.
//
// Receiver: as `joint`.
#include <algorithm>

#include "policies/builtin.h"
#include "policies/choice.h"
#include "policies/offload.h"

namespace interneuron::policies {
namespace {

// A link whose rate was measured within so many periods is in use; with two, one round may be
// missed.
constexpr int kRecentPeriods = 2;
// The share of time_left within which a link that is not in use must be. No measurement behind this
// value: it only has to be below 1 by more than the times of rounds differ, or the choice flaps.
constexpr double kRoomToReturn = 0.9;
// Grace and half-life of the confidence in a rate (src/core/link/nature.h).
constexpr Duration kRateStale = std::chrono::seconds(42);

// Evidence of everything but the rate is stale below this confidence: after one half-life.
constexpr double kStaleConfidence = 0.5;

// Whether nothing is known of a link that could speak against trying it.
bool stale(const LinkState& link) {
  return link.rate == DataRate{} || link.rate_age > kRateStale ||
         link.confidence < kStaleConfidence;
}

class Placement final : public Policy {
 public:
  std::string_view name() const override { return "placement"; }

  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    const bool known = guidance.local_quality > 0 && !guidance.levels.empty() &&
                       guidance.time_left != Duration::max();
    if (offer.qos.message_class == MessageClass::kData && known &&
        !worth_offloading(offer, links, guidance)) {
      Plan local;
      local.refused = kLocalIsBetter;
      return local;
    }
    return offloading_->plan(offer, links, guidance);
  }

  Merge merge(const Arrival& arrival) const override { return offloading_->merge(arrival); }

 private:
  // True also where no link is up, because then there is nothing to refuse.
  static bool worth_offloading(const Offer& offer, std::span<const LinkState> links,
                               const Guidance& guidance) {
    const Links able = fastest(links, {}, kAllLinks);
    if (able.empty() || std::ranges::all_of(able, stale)) return true;
    return std::ranges::any_of(able, [&](const LinkState& link) {
      Guidance within = guidance;
      const bool in_use = link.rate_age <= kRecentPeriods * offer.qos.period;
      if (!in_use) {
        within.time_left = Duration{static_cast<std::int64_t>(
            static_cast<double>(guidance.time_left.count()) * kRoomToReturn)};
      }
      const auto best = best_offload(offer, {&link, 1}, within);
      return best && best->quality > guidance.local_quality;
    });
  }

  std::shared_ptr<const Policy> offloading_ = joint();
};

}  // namespace

std::shared_ptr<const Policy> placement() { return std::make_shared<Placement>(); }

}  // namespace interneuron::policies
