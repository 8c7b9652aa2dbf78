#include "core/rounds/transmissions.h"

#include <algorithm>
#include <array>

#include "core/base/earliest.h"
#include "core/plan/budget.h"
#include "core/plan/plan_message.h"

namespace interneuron::rounds {
namespace {

// What is left of the deadline of a round after `theta`, which contains the clock offset `alpha`. A
// peer may say anything of when its round began, also of one that began here and comes back; within
// these bounds nobody who calculates with it leaves the range of a Duration.
Duration left_of(const dispatch::Round& round, Duration theta, std::int64_t alpha) {
  const Duration most = 2 * round.qos.deadline;
  const std::int64_t due = wrapping_add(round.qos.deadline.count(), alpha);
  return std::clamp(Duration{wrapping_sub(due, theta.count())}, -most, most);
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
  return rest + back.value_or(Duration::zero()) + plan::kComputeReserve;
}

Offer offer_of(const RoundContext& context, const Transmissions::Next& next) {
  Offer offer{context.round.qos, next.sizes, next.costs};
  offer.qos.message_class = next.message_class;
  for (std::size_t stage = 1; stage <= context.stage; ++stage) {
    if (context.round.is_communication(stage)) ++offer.earlier_communications;
  }
  return offer;
}

}  // namespace

// What the guard tells the policy of a round's next transmission.
Guidance Transmissions::guidance(TimePoint now, const RoundContext& context,
                                 const Stages::ClockOf& clock) const {
  const dispatch::Round& round = context.round;
  Guidance out{.degraded = context.verdict.late};
  if (context.mode) {
    out.degraded = context.mode->degraded;
    out.variant = context.mode->variant;
  }
  if (const guard::RoundLedger* ledger = own_.find(round.ref)) {
    out.time_left = left_of(round, elapsed_across(round.t0, now), 0);
    out.local_quality = ledger->config().fallback.local;
    if (!context.from) out.levels = ledger->config().levels;
    return out;
  }
  out.local_quality = round.terms.local_quality;
  if (clock) out.time_left = left_of(round, elapsed_across(round.t0, now), clock->alpha);
  return out;
}

void Transmissions::choose_mode(TimePoint now, RoundContext& context, const Next& next) const {
  guard::RoundLedger* ledger = own_.find(context.round.ref);
  if (context.from || ledger == nullptr || !ledger->weighs()) return;
  if (context.previewed && !context.previewed->fits(next.sizes.size(), next.links)) {
    context.mode.reset();
  }
  if (context.mode) return;
  const Offer offer = offer_of(context, next);
  Guidance ask = guidance(now, context, std::nullopt);
  // A message without a smaller variant can still be sent more safely, as a policy has it.
  const auto variant_in = [&](std::size_t mode) {
    return static_cast<std::uint8_t>(std::min(mode, next.sizes.size() - 1));
  };
  const std::size_t count = std::clamp<std::size_t>(next.sizes.size(), 2, kMaxVariants);
  std::array<guard::Forecast, kMaxVariants> modes;
  for (std::size_t mode = 0; mode < count; ++mode) {
    ask.degraded = mode + 1 == count;
    ask.variant = variant_in(mode);
    modes[mode] = plan::forecast_answers(plan(context, next, ask), offer, next.links);
  }
  const std::size_t mode =
      ledger->choose_mode(now, context.round.ref.round, std::span(modes).first(count));
  context.mode = {variant_in(mode), mode + 1 == count};
}

Plan Transmissions::plan(const RoundContext& context, const Next& next,
                         const Guidance& guidance) const {
  return plan::plan_message(policies_.find_or_first(context.round.policy), offer_of(context, next),
                            next.links, guidance);
}

Plan Transmissions::plan(TimePoint now, const RoundContext& context, const Next& next,
                         const Stages::ClockOf& clock) const {
  return plan(context, next, guidance(now, context, clock));
}

std::optional<Planned> Transmissions::send(TimePoint now, peers::Peer& peer, std::size_t room,
                                           RoundContext& context, const Next& next,
                                           const Stages::ClockOf& clock, Variants& variants) const {
  if (context.mode) context.verdict.late = context.mode->degraded;
  const Guidance guide = guidance(now, context, clock);
  dispatch::Round& round = context.round;
  round.stage = static_cast<std::uint8_t>(context.stage + 1);
  round.qos.message_class = next.message_class;
  round.degraded = context.verdict.late;
  if (clock) round.alpha_sum = Duration{clock->alpha};
  // The origin's own clock has no offset, so the sum starts over where a round passes its origin.
  if (own_.is_mine(round.ref)) round.alpha_sum = Duration::zero();

  const bool was_previewed =
      context.previewed && context.previewed->fits(next.sizes.size(), next.links);
  Planned planned{round.ref, round.stage,
                  was_previewed ? context.previewed->plan : plan(context, next, guide)};
  const dispatch::Itinerary itinerary(planned.plan);
  peer.paths().asked(now, next.sizes, round.qos.deadline);
  dispatch::seek_rate(now, peer, planned.plan, itinerary, round.qos, next.sizes.front());
  if (itinerary.empty()) return planned;
  if (itinerary.bytes(next.sizes, wire::MessageKind::kRound) > room) return std::nullopt;

  round.best_planned = itinerary.front().variant;
  flow::Sender::Times when = times(now, round, clock);
  if (next.message_class == MessageClass::kData) {
    when.aim = when.deadline - rest_of_round(next.links, guide);
  }
  dispatch::dispatch(now, peer, dispatch::header_of(round), itinerary, when,
                     dispatch::allowed_of(policies_.find_or_first(round.policy), next.links),
                     variants);
  return planned;
}

// The deadline of a message is t0 + D_N on this host's clock. While the origin's clock is not
// known, it is the latest that it can be.
flow::Sender::Times Transmissions::times(TimePoint now, const dispatch::Round& round,
                                         const Stages::ClockOf& clock) const {
  const Duration deadline = stages_.bounded_deadline(round);
  flow::Sender::Times out{.deadline = now + deadline, .lifetime = deadline};
  if (own_.is_mine(round.ref)) {
    out.deadline = when_elapsed(round.t0, deadline);
  } else if (clock) {
    out.doubt = clock->rtt_min / 2;
    out.deadline =
        std::min(out.deadline,
                 when_elapsed(round.t0, Duration{wrapping_add(clock->alpha, deadline.count())}));
  }
  return out;
}

}  // namespace interneuron::rounds
