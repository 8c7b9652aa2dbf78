#include "core/rounds/rounds.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "core/base/ablation.h"
#include "core/base/earliest.h"
#include "core/base/source_limit.h"
#include "core/dispatch/routes.h"
#include "core/plan/budget.h"

namespace interneuron::rounds {
namespace {

void check(const Variants& variants) {
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

// Whose bounds hold for a round that the application works on.
Stages::Speaker speaker_of(const RoundContext& context) {
  return {context.from.value_or(kOurselves), context.by_relay};
}

}  // namespace

Rounds::Rounds(const EndpointOptions& options, const plan::PolicyRegistry& policies,
               peers::Peers& peers, HeldMemory& held, std::deque<Event>& events)
    : peers_(peers),
      events_(events),
      relays_(options.relays),
      policies_(policies),
      own_(options.session, options.pipelines, options.ablation ? *options.ablation : Ablation{}),
      stages_(options.session, options.peer_limits,
              options.ablation ? *options.ablation : Ablation{}, held),
      transmissions_(policies_, own_, stages_) {
  if (options.session.value == 0) {
    throw std::invalid_argument("endpoint: the session must not be 0; draw it at random");
  }
  for (const PipelineConfig& config : options.pipelines) {
    if (policies_.find(config.policy) == nullptr) {
      throw std::invalid_argument("pipeline " + std::to_string(config.id.value) + ": policy '" +
                                  config.policy + "' is not registered; there are " +
                                  policies_.names());
    }
  }
}

RoundRef Rounds::begin(TimePoint now, PipelineId pipeline) {
  RoundContext context = own_.begin(now, pipeline);
  const RoundRef round = context.round.ref;
  stages_.open(now, std::move(context));
  return round;
}

SubmitStatus Rounds::submit(TimePoint now, const RoundRef& round, Variants variants,
                            MessageClass message_class, std::optional<PeerId> to) {
  check(variants);
  RoundContext* found = stages_.context(round);
  if (found == nullptr) {
    const bool was_open = own_.has_begun(round) || stages_.has_served(round);
    return was_open ? SubmitStatus::kRoundOver : SubmitStatus::kUnknownRound;
  }
  RoundContext context = *found;
  stages_.close(round);
  end_computations(now, context);
  if (context.stage == context.round.stages) {
    if (!own_.is_mine(round)) return SubmitStatus::kNoWayToOrigin;
    const PeerId from = context.from.value_or(kOurselves);
    const bool answered =
        finish(now, from, dispatch::as_told(context.round), std::move(variants.front()));
    return answered ? SubmitStatus::kAccepted : SubmitStatus::kRoundOver;
  }
  peers::Peer* peer = destination(now, context, to);
  if (peer == nullptr) return SubmitStatus::kNoPeer;
  const Links links = dispatch::links_behind_queue(now, *peer);
  const dispatch::Sizes sizes = dispatch::sizes_of(variants);
  const Transmissions::Next next{links, sizes, {}, message_class};
  transmissions_.choose_mode(now, context, next);
  const auto clock = clock_of(now, context.round, peers_.access(now, context.from));
  auto planned = transmissions_.send(now, *peer, peers_.send_room(peer->identity().id), context,
                                     next, clock, variants);
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
  if (found == nullptr || found->stage == found->round.stages) return {};
  peers::Peer* peer = destination(now, *found, to);
  if (peer == nullptr) return {};
  const Links links = dispatch::links_behind_queue(now, *peer);
  const Transmissions::Next next{links, variant_bytes, costs, message_class};
  transmissions_.choose_mode(now, *found, next);
  const auto clock = clock_of(now, found->round, peers_.access(now, found->from));
  found->previewed = Previewed{transmissions_.plan(now, *found, next, clock), variant_bytes.size()};
  return found->previewed->plan;
}

std::size_t Rounds::begin_computation(TimePoint now, const RoundRef& round,
                                      std::span<const LevelProfile> levels, std::size_t top) {
  RoundContext* context = stages_.context(round);
  if (context == nullptr || levels.empty()) return top;
  dispatch::Round& r = context->round;
  guard::StageEnd end = r.stage_end(context->stage);
  peers::Peer* from = peers_.access(now, context->from);
  if (from != nullptr) end.ahead = plan::soonest_way(dispatch::links_behind_queue(now, *from));
  const guard::LevelChoice choice =
      stage_guard_of(r, speaker_of(*context))
          .begin_computation(now, end, clock_of(now, r, from), levels,
                             std::min(top, levels.size() - 1), context->verdict);
  context->began = now;
  r.note_level(choice);
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

bool Rounds::is_relay(const peers::Peer& peer) const {
  return std::ranges::any_of(relays_, [&peer](const Address& relay) {
    return std::ranges::any_of(peer.paths(), [&relay](const peers::Path& path) {
      return is_same_host(path.address(), relay);
    });
  });
}

Stages::Speaker Rounds::speaker(const peers::Peer& peer) const {
  return {peer.identity().id, is_relay(peer)};
}

// Puts what is known of a round of ours in the place of what a peer says of it.
Rounds::Doubt Rounds::judge(const peers::Peer& peer, dispatch::Round& round) const {
  const PeerId from = peer.identity().id;
  if (!own_.is_mine(round.ref)) {
    if (round.stage == round.stages) return Doubt::kBad;
    if (round.ref.origin == peer.identity().session) return Doubt::kNone;
    if (!is_relay(peer)) return Doubt::kForeign;
    return stages_.is_of_another(from, round.ref) ? Doubt::kOfAnother : Doubt::kNone;
  }
  if (!own_.has_begun(round.ref)) return Doubt::kBad;
  const auto was_sent = own_.was_sent_to(round.ref, from);
  if (!was_sent) return Doubt::kForgotten;
  if (!*was_sent && !is_relay(peer)) return Doubt::kForeign;
  own_.restore(round);
  return Doubt::kNone;
}

void Rounds::complete(TimePoint now, peers::Peer& peer, wire::MessageBytes message) {
  const auto header = wire::parse_round_header(message.header_view());
  Arrived come{header ? dispatch::round_of(*header) : dispatch::Round{}, std::move(message.payload),
               peer.identity().id};
  switch (header ? judge(peer, come.round) : Doubt::kBad) {
    case Doubt::kNone:
      ++counters_.messages_completed;
      return arrived(now, peer, std::move(come));
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
void Rounds::arrived(TimePoint now, peers::Peer& peer, Arrived arrived) {
  const dispatch::Round round = arrived.round;
  const Stages::Speaker from = speaker(peer);
  guard::StageGuard& guard = stage_guard_of(round, from);
  if (!own_.is_mine(round.ref)) {
    guard.learn(now, round.ref.round, round.indicator, round.recent_e2e);
  }
  const auto clock = clock_of(now, round, &peer);
  const Policy* policy = policies_.find(round.policy);
  switch (stages_.arrive(now, from, arrived, policy, clock, guard)) {
    case Stages::Action::kHold:
      break;
    case Stages::Action::kDrop:
      ++counters_.messages_superseded;
      break;
    case Stages::Action::kServe:
      if (round.stage == round.stages) {
        finish(now, from.peer, round, std::move(arrived.payload));
      } else {
        const Verdict verdict = guard.end_stage(now, round.stage_end(round.stage), clock);
        events_.emplace_back(stages_.serve(now, from, std::move(arrived), verdict));
      }
  }
  for (const PeerLimit limit : stages_.take_struck()) peer.strike(now, limit);
}

// Nothing is kept of a peer that is gone, so that this one is there.
void Rounds::release(TimePoint now, Held held) {
  peers::Peer* peer = peers_.access(now, held.arrived.from);
  if (peer == nullptr) return;
  const dispatch::Round round = held.arrived.round;
  const Stages::Speaker from = speaker(*peer);
  if (round.stage == round.stages) {
    finish(held.hold.until, from.peer, round, std::move(held.arrived.payload));
    return;
  }
  const Verdict verdict =
      stage_guard_of(round, from).end_stage_held(round.stage_end(round.stage), held.hold);
  events_.emplace_back(stages_.serve(held.hold.until, from, std::move(held.arrived), verdict));
  for (const PeerLimit limit : stages_.take_struck()) peer->strike(now, limit);
}

// The last stage has ended: this is a result for a round that began here. False: it is late.
bool Rounds::finish(TimePoint now, PeerId from, const dispatch::Round& round, Bytes result) {
  stages_.finish(from, round);
  auto done = own_.find(round.ref)->remote_result(now, round.ref.round, std::move(result),
                                                  round.degraded, round.spent());
  if (!done) {
    ++counters_.messages_late;
    return false;
  }
  report(std::move(done));
  return true;
}

guard::StageGuard& Rounds::stage_guard_of(const dispatch::Round& round,
                                          const Stages::Speaker& speaker) {
  if (guard::RoundLedger* ledger = own_.find(round.ref)) return ledger->stage_guard();
  return stages_.stage_guard(round, speaker);
}

// The clock between the origin of a round and here: the sum over the hops so far, which the message
// told, plus the last hop.
Rounds::ClockOf Rounds::clock_of(TimePoint now, const dispatch::Round& round, peers::Peer* peer) {
  if (own_.is_mine(round.ref) || peer == nullptr) return std::nullopt;
  auto view = peer->clock(now);
  if (view) view->alpha = wrapping_add(view->alpha, round.alpha_sum.count());
  return view;
}

peers::Peer* Rounds::destination(TimePoint now, const RoundContext& context,
                                 std::optional<PeerId> to) {
  if (to) return peers_.access(now, to);
  if (context.from) return peers_.access(now, context.from);
  return peers_.access_only(now);
}

// The application hands its result over with submit(), so the computations up to the next
// communication end now.
void Rounds::end_computations(TimePoint now, RoundContext& context) {
  const std::size_t before = context.stage;
  dispatch::Round& r = context.round;
  while (context.stage < r.stages && !r.is_communication(context.stage + 1)) {
    ++context.stage;
    context.verdict = stage_guard_of(r, speaker_of(context))
                          .end_stage(now, r.stage_end(context.stage),
                                     clock_of(now, r, peers_.access(now, context.from)));
  }
  if (context.stage > before) r.note_computed(now - context.began);
}

}  // namespace interneuron::rounds
