#include "core/plan/plan_message.h"

#include <algorithm>

#include "core/base/slow_link.h"
#include "interneuron/sizes.h"

namespace interneuron::plan {
namespace {

bool is_small_result(const Offer& offer) {
  return offer.qos.message_class == MessageClass::kResult &&
         offer.variant_bytes.front() <= kSmallResultBytes;
}

bool is_suspected(const LinkState& link) { return link.up && link.path == PathState::kSuspect; }
bool is_sound(const LinkState& link) { return link.up && !is_suspected(link); }

// Whether a result is better sent over this one of two slow links, whose rates are known.
bool is_sooner(const LinkState& a, const LinkState& b, std::size_t bytes) {
  if (is_sound(a) != is_sound(b)) return is_sound(a);
  const auto arrival = [bytes](const LinkState& link) {
    return link.rtt_min / 2 + link.queue_up + link.usable_rate().transmit_time(wire_size(bytes));
  };
  return arrival(a) < arrival(b);
}

// A copy of a small result costs a fast link next to nothing. A slow one carries it where results
// like it take at most this share of it; else it would be in the way of those that follow.
constexpr double kCopyShare = 0.25;

// Small results go over every link, and over a slow one where a copy is cheap there or where no
// other link brings it sooner.
Plan over_every_link(const Policy& policy, const Offer& offer, std::span<const LinkState> links) {
  const std::size_t bytes = offer.variant_bytes.front();
  const DataRate cheap = rate_floor(offer.qos, wire_size(bytes)).scaled(1 / kCopyShare);
  const auto is_dear = [cheap](const LinkState& link) {
    return is_slow(link.rate) && link.usable_rate() < cheap;
  };
  Plan plan;
  const LinkState* soonest = nullptr;
  for (const LinkState& link : links) {
    if (!link.up || !policy.allows(link)) continue;
    if (!is_dear(link)) {
      plan.sends.push_back({.variant = 0, .link = link.id});
    } else if (soonest == nullptr || is_sooner(link, *soonest, bytes)) {
      soonest = &link;
    }
  }
  if (plan.sends.empty() && soonest != nullptr) plan.sends.push_back({0, soonest->id});
  return plan;
}

bool can_be_sent(const Policy& policy, const Assignment& send, const Offer& offer,
                 std::span<const LinkState> links) {
  return send.variant < offer.variant_bytes.size() &&
         std::ranges::any_of(links, [&](const LinkState& link) {
           return link.up && link.id == send.link && policy.allows(link);
         });
}

bool sets_out(const Assignment& send) {
  return send.role == SendRole::kWhole || send.role == SendRole::kShare;
}

bool sets_out(const Plan& plan, std::uint8_t variant, SendRole role) {
  return std::ranges::any_of(plan.sends, [variant, role](const Assignment& send) {
    return send.variant == variant && send.role == role;
  });
}

// The best variant that sets out.
std::uint8_t best_of(const Plan& plan) {
  std::uint8_t best = UINT8_MAX;
  for (const Assignment& send : plan.sends) {
    if (sets_out(send)) best = std::min(best, send.variant);
  }
  return best;
}

// Takes out what has no meaning beside the rest.
void settle_roles(Plan& plan) {
  const Plan all = plan;
  const bool any_sets_out =
      std::ranges::any_of(all.sends, [](const Assignment& send) { return sets_out(send); });
  plan.sends = {};
  for (const Assignment& send : all.sends) {
    const bool whole = sets_out(all, send.variant, SendRole::kWhole);
    const bool makes_sense = send.role == SendRole::kShare ? !whole
                             : send.role == SendRole::kParity
                                 ? whole || sets_out(all, send.variant, SendRole::kShare)
                                 : true;
    if (any_sets_out && makes_sense) plan.sends.push_back(send);
  }
}

// Whether a plan brings a variant that is as good as the other's best one in time, over these
// links.
bool is_as_good(const Plan& plan, const Plan& other, const Offer& offer,
                std::span<const LinkState> links, const Guidance& guidance) {
  if (plan.sends.empty() || plan.under_floor || best_of(plan) > best_of(other)) return false;
  const Duration most = std::min(guidance.time_left, offer.qos.deadline);
  return std::ranges::any_of(plan.sends, [&](const Assignment& send) {
    const auto link = std::ranges::find(links, send.link, &LinkState::id);
    return sets_out(send) && send.variant <= best_of(other) && link != links.end() && link->up &&
           send.variant < offer.variant_bytes.size() &&
           arrival_time(*link, offer.variant_bytes[send.variant]) <= most;
  });
}

// What the policy plans, or what it plans without the links that are suspected: where its plan
// rests on these, and the other one is as good.
Plan plan_around(const Policy& policy, const Offer& offer, std::span<const LinkState> links,
                 const Guidance& guidance) {
  Plan with = policy.plan(offer, links, guidance);
  Links sound;
  bool any_suspected = false;
  for (const LinkState& link : links) {
    LinkState seen = link;
    seen.up = is_sound(link);
    sound.push_back(seen);
    any_suspected = any_suspected || is_suspected(link);
  }
  // The guard of a round weighs time and quality itself, and suspicion is often wrong.
  const bool is_of_a_round = offer.qos.period > Duration::zero();
  if (with.sends.empty() || !any_suspected || is_of_a_round) return with;
  if (is_as_good(with, with, offer, sound, guidance)) return with;
  Plan without = policy.plan(offer, sound, guidance);
  return is_as_good(without, with, offer, sound, guidance) ? without : with;
}

}  // namespace

Plan plan_message(const Policy& policy, const Offer& offer, std::span<const LinkState> links,
                  const Guidance& guidance) {
  if (offer.variant_bytes.empty() || std::ranges::none_of(links, &LinkState::up)) return {};
  if (is_small_result(offer)) {
    Plan everywhere = over_every_link(policy, offer, links);
    if (!everywhere.sends.empty()) return everywhere;
    // The policy allows none of the links; its plan() says why.
  }

  const Plan answer = plan_around(policy, offer, links, guidance);
  Plan plan;
  for (const Assignment& send : answer.sends) {
    const bool repeated = std::ranges::find(plan.sends, send) != plan.sends.end();
    if (!repeated && can_be_sent(policy, send, offer, links)) plan.sends.push_back(send);
  }
  settle_roles(plan);
  plan.under_floor = answer.under_floor && !plan.sends.empty();
  if (plan.sends.empty()) plan.refused = answer.refused;
  if (answer.sends.empty() && plan.refused.empty()) plan.refused = kNothingPlanned;
  return plan;
}

DataRate rate_wanted(const QoS& qos, std::size_t bytes) {
  return std::max(rate_floor(qos, bytes), rate_of(wire_size(bytes), qos.deadline / 2));
}

}  // namespace interneuron::plan
