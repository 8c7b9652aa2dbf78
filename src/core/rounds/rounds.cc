#include "core/rounds/rounds.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

#include "core/base/ablation.h"
#include "core/base/earliest.h"
#include "core/base/same_host.h"
#include "core/plan/budget.h"
#include "core/rounds/round_terms.h"

namespace interneuron {
namespace {

// "best_link, duplicate, …", in the order of their registration.
std::string names_of(const PolicySet& policies) {
  std::string names;
  for (const auto& policy : policies) {
    if (!names.empty()) names += ", ";
    names += policy->name();
  }
  return names;
}

// What is left of the deadline of a round after `theta`, which contains the clock offset `alpha`. A
// peer may say anything of when its round began, also of one that began here and comes back; within
// these bounds nobody who calculates with it leaves the range of a Duration.
Duration left_of(const wire::RoundHeader& header, Duration theta, std::int64_t alpha) {
  const Duration most = 2 * header.deadline();
  const std::int64_t due = wrapping_add(header.deadline().count(), alpha);
  return std::clamp(Duration{wrapping_sub(due, theta.count())}, -most, most);
}

}  // namespace

Rounds::Rounds(const EndpointOptions& options, Peers& peers, std::deque<Event>& events)
    : peers_(peers),
      events_(events),
      relays_(options.relays),
      dispatch_(options.session, options.policies, options.peer_limits.longest_deadline),
      own_(options.session, options.pipelines, options.ablation ? *options.ablation : Ablation{}),
      stages_(options.session, options.peer_limits,
              options.ablation ? *options.ablation : Ablation{}) {
  if (options.session.value == 0) {
    throw std::invalid_argument("endpoint: the session must not be 0; draw it at random");
  }
  for (const PipelineConfig& config : options.pipelines) {
    if (dispatch_.policy(wire::policy_id(config.policy)) == nullptr) {
      throw std::invalid_argument("pipeline " + std::to_string(config.id.value) + ": policy '" +
                                  config.policy + "' is not registered; there are " +
                                  names_of(options.policies));
    }
  }
}

RoundRef Rounds::begin(TimePoint now, PipelineId pipeline) {
  RoundContext context = own_.begin(now, pipeline);
  const RoundRef round = context.header.round;
  stages_.open(now, std::move(context));
  return round;
}

SubmitStatus Rounds::submit(TimePoint now, const RoundRef& round, Variants variants,
                            MessageClass message_class, std::optional<PeerId> to) {
  Dispatch::check(variants);
  RoundContext* found = stages_.context(round);
  if (found == nullptr) {
    const bool was_open = own_.has_begun(round) || stages_.has_served(round);
    return was_open ? SubmitStatus::kRoundOver : SubmitStatus::kUnknownRound;
  }
  RoundContext context = *found;
  stages_.close(round);
  end_computations(now, context);
  if (context.stage == context.header.stages) {
    if (!own_.is_mine(round)) return SubmitStatus::kNoWayToOrigin;
    const PeerId from = context.from.value_or(kOurselves);
    const bool answered = finish(now, from, context.header, std::move(variants.front()));
    return answered ? SubmitStatus::kAccepted : SubmitStatus::kRoundOver;
  }
  Peer* peer = destination(now, context, to);
  if (peer == nullptr) return SubmitStatus::kNoPeer;
  choose_mode(now, context, *peer, message_class, Dispatch::sizes_of(variants), {});
  if (context.mode) context.verdict.late = context.mode->degraded;
  const auto clock = clock_of(now, context.header, peers_.access(now, context.from));
  auto planned = dispatch_.send(now, *peer, peers_.send_room(peer->identity().id), context, clock,
                                variants, message_class, guidance(now, context, clock));
  if (!planned) return SubmitStatus::kOverBudget;
  const bool sent = !planned->plan.sends.empty();
  const bool kept_here = !planned->plan.refused.empty();
  events_.emplace_back(std::move(*planned));
  guard::RoundLedger* ledger = own_.find(round);
  if (kept_here && ledger != nullptr) report(ledger->stay_local(now, round.round));
  if (sent) own_.note_sent(round, peer->identity().id);
  if (sent) return SubmitStatus::kAccepted;
  return kept_here ? SubmitStatus::kRefusedByPolicy : SubmitStatus::kNoLink;
}

Plan Rounds::preview(TimePoint now, const RoundRef& round,
                     std::span<const std::size_t> variant_bytes, MessageClass message_class,
                     std::span<const VariantCost> costs, std::optional<PeerId> to) {
  RoundContext* found = stages_.context(round);
  if (found == nullptr || found->stage == found->header.stages) return {};
  Peer* peer = destination(now, *found, to);
  if (peer == nullptr) return {};
  choose_mode(now, *found, *peer, message_class, variant_bytes, costs);
  wire::RoundHeader header = found->header;
  header.stage = static_cast<std::uint8_t>(found->stage + 1);
  header.message_class = message_class;
  const auto clock = clock_of(now, header, peers_.access(now, found->from));
  found->previewed =
      Previewed{dispatch_.plan(peer->links(now), header, {qos_of(header), variant_bytes, costs},
                               guidance(now, *found, clock)),
                variant_bytes.size()};
  return found->previewed->plan;
}

std::size_t Rounds::begin_computation(TimePoint now, const RoundRef& round,
                                      std::span<const LevelProfile> levels, std::size_t top) {
  RoundContext* context = stages_.context(round);
  if (context == nullptr || levels.empty()) return top;
  wire::RoundHeader& h = context->header;
  guard::StageEnd end = stage_end(h, context->stage);
  Peer* from = peers_.access(now, context->from);
  if (from != nullptr) end.ahead = soonest_way(from->links(now));
  const guard::LevelChoice choice =
      observer_of(h, {context->from.value_or(kOurselves), context->by_relay})
          .begin_computation(now, end, clock_of(now, h, from), levels,
                             std::min(top, levels.size() - 1), context->verdict);
  context->began = now;
  note_level(h, choice);
  return choice.level;
}

void Rounds::local_result(TimePoint now, const RoundRef& round, Bytes result) {
  if (guard::RoundLedger* ledger = own_.find(round)) {
    report(ledger->local_result(now, round.round, std::move(result)));
  }
}

void Rounds::give_up(TimePoint now, const RoundRef& round) {
  if (guard::RoundLedger* ledger = own_.find(round)) report(ledger->give_up(now, round.round));
}

// Hands the answer of a round to the application, if there is one.
void Rounds::report(std::optional<RoundDone> done) {
  if (!done) return;
  stages_.close(done->round);
  events_.emplace_back(std::move(*done));
}

void Rounds::expire(TimePoint now) {
  for (Held& released : stages_.release(now)) release(now, std::move(released));
  for (RoundDone& done : own_.expire(now)) report(std::move(done));
}

std::optional<TimePoint> Rounds::next_timeout() const {
  return earliest(stages_.next_timeout(), own_.next_timeout());
}

bool Rounds::is_relay(const Peer& peer) const {
  return std::ranges::any_of(relays_, [&peer](const Address& relay) {
    return std::ranges::any_of(
        peer.paths(), [&relay](const Path& path) { return is_same_host(path.address(), relay); });
  });
}

Stages::Sender Rounds::sender(const Peer& peer) const {
  return {peer.identity().id, is_relay(peer)};
}

// Puts what is known of a round of ours in the place of what the header says of it.
Rounds::Doubt Rounds::judge(const Peer& peer, wire::RoundHeader& header) const {
  const PeerId from = peer.identity().id;
  if (!own_.is_mine(header.round)) {
    if (header.stage == header.stages) return Doubt::kBad;
    if (header.round.origin == peer.identity().session) return Doubt::kNone;
    if (!is_relay(peer)) return Doubt::kForeign;
    return stages_.is_of_another(from, header.round) ? Doubt::kOfAnother : Doubt::kNone;
  }
  if (!own_.has_begun(header.round)) return Doubt::kBad;
  const auto was_sent = own_.was_sent_to(header.round, from);
  if (!was_sent) return Doubt::kForgotten;
  if (!*was_sent && !is_relay(peer)) return Doubt::kForeign;
  own_.restore(header);
  return Doubt::kNone;
}

void Rounds::complete(TimePoint now, Peer& peer, wire::MessageBytes message) {
  auto header = wire::parse_round_header(message.header_view());
  switch (header ? judge(peer, *header) : Doubt::kBad) {
    case Doubt::kNone:
      ++counters_.messages_completed;
      return arrived(now, peer, *header, std::move(message.payload));
    case Doubt::kBad:
      ++counters_.bad_messages;
      return;
    case Doubt::kForeign:
      ++counters_.foreign_rounds;
      peer.strike(now, PeerLimit::kOrigin);
      return;
    case Doubt::kForgotten:
      ++counters_.messages_completed;
      ++counters_.messages_late;
      return;
    case Doubt::kOfAnother:
      ++counters_.messages_completed;
      ++counters_.messages_superseded;
      return;
  }
}

// A message that may be what its header says.
void Rounds::arrived(TimePoint now, Peer& peer, const wire::RoundHeader& header, Bytes payload) {
  Arrived arrived{header, std::move(payload), peer.identity().id};
  const Stages::Sender from = sender(peer);
  guard::StageGuard& observer = observer_of(header, from);
  if (!own_.is_mine(header.round)) {
    observer.learn(now, header.round.round, header.indicator, recent_e2e(header));
  }
  const auto clock = clock_of(now, header, &peer);
  const Policy* policy = dispatch_.policy(header.policy);
  switch (stages_.arrive(now, from, arrived, policy, clock, observer)) {
    case Stages::Action::kHold:
      break;
    case Stages::Action::kDrop:
      ++counters_.messages_superseded;
      break;
    case Stages::Action::kServe:
      if (header.stage == header.stages) {
        finish(now, from.peer, header, std::move(arrived.payload));
      } else {
        events_.emplace_back(stages_.serve(now, from, std::move(arrived), clock, observer));
      }
  }
  for (const PeerLimit limit : stages_.take_struck()) peer.strike(now, limit);
}

// Nothing is kept of a peer that is gone, so that this one is there.
void Rounds::release(TimePoint now, Held released) {
  const wire::RoundHeader header = released.arrived.header;
  Peer* peer = peers_.access(now, released.arrived.from);
  if (peer == nullptr) return;
  const Stages::Sender from = sender(*peer);
  if (header.stage == header.stages) {
    finish(released.hold.until, from.peer, header, std::move(released.arrived.payload));
    return;
  }
  guard::StageGuard& observer = observer_of(header, from);
  events_.emplace_back(stages_.serve_held(from, std::move(released), observer));
  for (const PeerLimit limit : stages_.take_struck()) peer->strike(now, limit);
}

// The last stage has ended: this is a result for a round that began here. False: it is late.
bool Rounds::finish(TimePoint now, PeerId from, const wire::RoundHeader& header, Bytes result) {
  stages_.finish(from, header);
  auto done = own_.find(header.round)
                  ->remote_result(now, header.round.round, std::move(result), header.degraded,
                                  spent_of(header));
  if (!done) {
    ++counters_.messages_late;
    return false;
  }
  report(std::move(done));
  return true;
}

guard::StageGuard& Rounds::observer_of(const wire::RoundHeader& header,
                                       const Stages::Sender& sender) {
  if (guard::RoundLedger* ledger = own_.find(header.round)) return ledger->observer();
  return stages_.observer(header, sender);
}

// The clock between the origin of a round and here: the sum over the hops so far, which the header
// carries, plus the last hop.
Rounds::ClockOf Rounds::clock_of(TimePoint now, const wire::RoundHeader& header, Peer* peer) {
  if (own_.is_mine(header.round) || peer == nullptr) return std::nullopt;
  auto view = peer->clock(now);
  if (view) view->alpha = wrapping_add(view->alpha, header.alpha_sum.count());
  return view;
}

Peer* Rounds::destination(TimePoint now, const RoundContext& context, std::optional<PeerId> to) {
  if (to) return peers_.access(now, to);
  if (context.from) return peers_.access(now, context.from);
  return peers_.access_only(now);
}

// The application hands its result over with submit(), so the computations up to the next
// communication end now.
void Rounds::end_computations(TimePoint now, RoundContext& context) {
  const std::size_t before = context.stage;
  while (context.stage < context.header.stages &&
         !context.header.is_communication(context.stage + 1)) {
    ++context.stage;
    guard::StageGuard& observer =
        observer_of(context.header, {context.from.value_or(kOurselves), context.by_relay});
    context.verdict =
        observer.end_stage(now, stage_end(context.header, context.stage),
                           clock_of(now, context.header, peers_.access(now, context.from)));
  }
  if (context.stage > before) note_computed(context.header, now - context.began);
}

// What the guard tells the policy of a round's next transmission.
Guidance Rounds::guidance(TimePoint now, const RoundContext& context, const ClockOf& clock) {
  const wire::RoundHeader& h = context.header;
  Guidance out{.degraded = context.verdict.late};
  if (context.mode) {
    out.degraded = context.mode->degraded;
    out.variant = context.mode->variant;
  }
  if (guard::RoundLedger* ledger = own_.find(h.round)) {
    out.time_left = left_of(h, elapsed_across(h.t0, now), 0);
    out.local_quality = ledger->config().fallback.local;
    if (!context.from) out.levels = ledger->config().levels;
  } else {
    out.local_quality = h.local_quality / 255.0;
    if (clock) {
      out.time_left = left_of(h, elapsed_across(h.t0, now), clock->alpha);
    }
  }
  return out;
}

// Decides the mode of the first transmission of a round that began here, where its guard weighs the
// modes.
void Rounds::choose_mode(TimePoint now, RoundContext& context, const Peer& peer,
                         MessageClass message_class, std::span<const std::size_t> variant_bytes,
                         std::span<const VariantCost> costs) {
  guard::RoundLedger* ledger = own_.find(context.header.round);
  if (context.from || ledger == nullptr || !ledger->weighs()) return;
  const Links links = peer.links(now);
  // Another message than the one that preview() was asked about, or other links.
  if (context.previewed && !context.previewed->fits(variant_bytes.size(), links)) {
    context.mode.reset();
  }
  if (context.mode) return;
  wire::RoundHeader header = context.header;
  header.message_class = message_class;
  const Offer offer{qos_of(header), variant_bytes, costs};
  Guidance ask = guidance(now, context, std::nullopt);
  // A message without a smaller variant can still be sent more safely, as a policy has it.
  const auto variant_in = [&](std::size_t mode) {
    return static_cast<std::uint8_t>(std::min(mode, variant_bytes.size() - 1));
  };
  const std::size_t count = std::clamp<std::size_t>(variant_bytes.size(), 2, kMaxVariants);
  std::array<guard::Forecast, kMaxVariants> modes;
  for (std::size_t mode = 0; mode < count; ++mode) {
    ask.degraded = mode + 1 == count;
    ask.variant = variant_in(mode);
    modes[mode] = forecast_answers(dispatch_.plan(links, header, offer, ask), offer, links);
  }
  const std::size_t mode =
      ledger->choose_mode(now, header.round.round, std::span(modes).first(count));
  context.mode = {variant_in(mode), mode + 1 == count};
}

}  // namespace interneuron
