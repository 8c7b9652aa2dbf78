#include "core/rounds/dispatch.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/base/earliest.h"
#include "core/plan/budget.h"
#include "core/plan/carriers.h"
#include "core/plan/plan_message.h"
#include "core/rounds/round_terms.h"

namespace interneuron {
namespace {

wire::MessageBytes with(const wire::RoundHeader& header, Bytes payload) {
  std::array<std::byte, wire::kRoundHeaderBytes> bytes;
  wire::write_round_header(bytes, header);
  return {bytes, std::move(payload)};
}

// The links that the policy allows: lost pieces go over no other.
flow::PathSet allowed_of(const Policy& policy, std::span<const LinkState> links) {
  flow::PathSet allowed;
  for (const LinkState& link : links) {
    if (policy.allows(link)) allowed.add(link.id);
  }
  return allowed;
}

// The rate of a link that could carry a message of so many bytes: the floor that policies ask for,
// or what brings it within half the deadline, since the other half may go by on the way and back.
DataRate rate_wanted(const QoS& qos, std::size_t bytes) {
  return std::max(rate_floor(qos, bytes), rate_of(wire_size(bytes), qos.deadline / 2));
}

// What the variants that a plan sends take, with their headers; each once, over however many links.
std::size_t bytes_of(const Plan& plan, const Variants& variants) {
  std::size_t bytes = 0;
  for (std::size_t v = 0; v < variants.size(); ++v) {
    const bool is_sent =
        std::ranges::any_of(plan.sends, [v](const Assignment& a) { return a.variant == v; });
    if (is_sent) bytes += wire::kRoundHeaderBytes + variants[v].size();
  }
  return bytes;
}

// What follows a message that is computed on, at the least: the lowest level, if it is known, and
// the way back over the link that is soonest.
Duration rest_of_round(std::span<const LinkState> links, const Guidance& guidance) {
  Duration rest = guidance.levels.empty() ? Duration::zero() : guidance.levels.front().p95;
  std::optional<Duration> back;
  for (const LinkState& link : links) {
    if (!link.up || link.rtt_p50 == Duration::zero()) continue;
    back = earliest(back, link.rtt_p50 / 2 + link.queue_down);
  }
  return rest + back.value_or(Duration::zero()) + kComputeReserve;
}

// How many stages before the communication header.stage, which is about to begin, were
// communications.
std::uint8_t earlier_communications(const wire::RoundHeader& header) {
  std::uint8_t count = 0;
  for (std::size_t stage = 1; stage < header.stage; ++stage) {
    if (header.is_communication(stage)) ++count;
  }
  return count;
}

}  // namespace

Dispatch::Dispatch(SessionId self, const PolicySet& policies, Duration longest_deadline)
    : self_(self), longest_deadline_(longest_deadline) {
  for (const auto& policy : policies) {
    if (policy == nullptr) throw std::invalid_argument("endpoint: a policy is null");
    policies_[wire::policy_id(policy->name())] = policy;
  }
  if (policies_.empty()) throw std::invalid_argument("endpoint: no policy is registered");
  stand_in_ = policies.front();
}

const Policy* Dispatch::policy(std::uint32_t id) const {
  const auto it = policies_.find(id);
  return it == policies_.end() ? nullptr : it->second.get();
}

void Dispatch::check(const Variants& variants) {
  if (variants.empty() || variants.size() > kMaxVariants) {
    throw std::invalid_argument("submit: " + std::to_string(variants.size()) +
                                " variants; give 1 to " + std::to_string(kMaxVariants));
  }
  for (const Bytes& bytes : variants) {
    if (bytes.size() > kMaxMessageBytes) {
      throw std::invalid_argument("submit: a variant of " + std::to_string(bytes.size()) +
                                  " bytes; at most " + std::to_string(kMaxMessageBytes));
    }
  }
}

Dispatch::Sizes Dispatch::sizes_of(const Variants& variants) {
  Sizes sizes;
  for (const Bytes& v : variants) sizes.push_back(v.size());
  return sizes;
}

// The policy that the origin names, or the first registered one: without the right policy any
// delivers the message.
const Policy& Dispatch::rule(const wire::RoundHeader& header) const {
  const Policy* named = policy(header.policy);
  return named != nullptr ? *named : *stand_in_;
}

Plan Dispatch::plan(std::span<const LinkState> links, const wire::RoundHeader& header,
                    const Offer& offer, const Guidance& guidance) const {
  Offer complete = offer;
  complete.earlier_communications = earlier_communications(header);
  return plan_message(rule(header), complete, links, guidance);
}

std::optional<Planned> Dispatch::send(TimePoint now, Peer& peer, std::size_t room,
                                      const RoundContext& context, const ClockOf& clock,
                                      Variants& variants, MessageClass message_class,
                                      const Guidance& guidance) const {
  wire::RoundHeader header = context.header;
  header.stage = static_cast<std::uint8_t>(context.stage + 1);
  header.message_class = message_class;
  header.degraded = context.verdict.late;
  if (clock) header.alpha_sum = Duration{clock->alpha};
  // The origin's own clock has no offset, so the sum starts over where a round passes its origin.
  if (header.round.origin == self_) header.alpha_sum = Duration::zero();

  const Links links = peer.links(now);
  Planned planned{header.round, header.stage, {}};
  if (context.previewed && context.previewed->fits(variants.size(), links)) {
    planned.plan = context.previewed->plan;
  } else {
    planned.plan = plan(links, header, {qos_of(header), sizes_of(variants)}, guidance);
  }
  const auto& sends = planned.plan.sends;
  const bool best_is_sent = !sends.empty() && best_planned(planned.plan) == 0;
  if (!best_is_sent || planned.plan.under_floor) {
    peer.want(now, rate_wanted(qos_of(header), variants.front().size()));
  }
  if (sends.empty()) return planned;
  if (bytes_of(planned.plan, variants) > room) return std::nullopt;

  header.best_planned = best_planned(planned.plan);
  flow::Sender::Times times{deadline_of(now, header, clock), Duration::zero(), believed(header)};
  if (header.round.origin != self_ && clock) times.doubt = clock->rtt_min / 2;
  if (message_class == MessageClass::kData) {
    times.aim = times.deadline - rest_of_round(links, guidance);
  }
  const flow::PathSet repairs = allowed_of(rule(header), links);
  MessageId first{};
  std::optional<MessageId> better;
  for (const Carriers& c : carriers_of(planned.plan)) {
    header.variant = c.variant;
    // It is sent once the better ones are given up, so the receiver need not wait for these.
    header.degraded = context.verdict.late || !c.sets_out();
    const flow::PathSet shadow = flow::PathSet::of(c.shadow);
    wire::MessageBytes message = with(header, std::move(variants[c.variant]));
    if (!c.sets_out()) {
      peer.sender().add_alternative(now, first, std::move(message), shadow);
      continue;
    }
    first = peer.send(now, times, std::move(message), std::span(c.links), repairs,
                      wire::MessageKind::kRound, {c.divided, flow::PathSet::of(c.parity), shadow});
    // Else the repairs of a small image that nobody needs any more delay the next frame.
    if (better) peer.sender().supersede(*better, first);
    better = first;
  }
  return planned;
}

// t0 + D_N on this host's clock. While the origin's clock is not known, the latest that it can be.
TimePoint Dispatch::deadline_of(TimePoint now, const wire::RoundHeader& header,
                                const ClockOf& clock) const {
  if (header.round.origin == self_) return when_elapsed(header.t0, header.deadline());
  const Duration deadline = believed(header);
  if (!clock) return now + deadline;
  const TimePoint by_clock =
      when_elapsed(header.t0, Duration{wrapping_add(clock->alpha, deadline.count())});
  return std::min(by_clock, now + deadline);
}

Duration Dispatch::believed(const wire::RoundHeader& header) const {
  if (header.round.origin == self_) return header.deadline();
  return std::min<Duration>(header.deadline(), longest_deadline_);
}

}  // namespace interneuron
