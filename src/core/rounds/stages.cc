#include "core/rounds/stages.h"

namespace interneuron::rounds {

guard::StageGuard& Stages::stage_guard(const dispatch::Round& round, const Speaker& speaker) {
  Pipeline& found = pipeline(round, speaker);
  if (!found.guard || found.kind != round.terms.kind) {
    found.guard = guard::make_stage_guard(round.terms.kind, false, ablation_);
    found.kind = round.terms.kind;
  }
  return *found.guard;
}

Stages::Pipeline& Stages::pipeline(const dispatch::Round& round, const Speaker& speaker) {
  const Key key{owner(speaker.peer, round), round.ref.origin, round.ref.pipeline};
  auto it = pipelines_.find(key);
  if (it == pipelines_.end()) {
    if (!is_own(round)) make_room_for_pipeline(speaker);
    it = pipelines_.try_emplace(key).first;
  }
  it->second.used = ++uses_;
  return it->second;
}

// The peer's own that was least recently used goes where it has as many as it may.
void Stages::make_room_for_pipeline(const Speaker& speaker) {
  const auto first = pipelines_.lower_bound({speaker.peer, {}, {}});
  auto oldest = first;
  std::size_t count = 0;
  for (auto it = first; it != pipelines_.end() && it->first.peer == speaker.peer; ++it) {
    ++count;
    if (it->second.used < oldest->second.used) oldest = it;
  }
  if (count < scaled(limits_.pipelines, speaker)) return;
  strike(PeerLimit::kPipelines);
  pipelines_.erase(oldest);
}

void Stages::forget_clock(PeerId peer) {
  for (auto it = pipelines_.lower_bound({peer, {}, {}});
       it != pipelines_.end() && it->first.peer == peer; ++it) {
    if (it->second.guard) it->second.guard->reset();
  }
}

void Stages::forget(PeerId peer) {
  const auto first = pipelines_.lower_bound({peer, {}, {}});
  auto last = first;
  while (last != pipelines_.end() && last->first.peer == peer) ++last;
  pipelines_.erase(first, last);
  contexts_.forget(peer);
  held_.forget(peer);
}

// Nothing when the round is so old that its slot belongs to a younger one, or when nothing is kept
// of its pipeline any more.
Stages::Served* Stages::served(PeerId peer, const dispatch::Round& round) {
  const auto it = pipelines_.find({owner(peer, round), round.ref.origin, round.ref.pipeline});
  return it == pipelines_.end() ? nullptr : it->second.served.enter(round.ref.round);
}

bool Stages::has_served(const RoundRef& round) const {
  return std::ranges::any_of(pipelines_, [&round](const auto& entry) {
    if (entry.first.origin != round.origin || entry.first.pipeline != round.pipeline) return false;
    const Served* stages = entry.second.served.find(round.round);
    return stages != nullptr && *stages != 0;
  });
}

// An origin is not believed everything, and whoever speaks for it is told so in the ledger.
void Stages::strike_long_deadline(const dispatch::Round& round) {
  if (bounded_deadline(round) < round.qos.deadline) strike(PeerLimit::kDeadline);
}

Stages::Action Stages::arrive(TimePoint now, const Speaker& speaker, Arrived& arrived,
                              const Policy* policy, const ClockOf& clock,
                              guard::StageGuard& guard) {
  const dispatch::Round& r = arrived.round;
  guard.note_arrival(now, r.stage_end(r.stage));
  // The guard of a round that began here lies elsewhere, so that its pipeline may be new here.
  if (is_own(r)) pipeline(r, speaker);
  const Served* stages = served(speaker.peer, r);
  if (stages == nullptr || ((*stages >> r.stage) & 1U) != 0) return Action::kDrop;
  const Held* held = held_.find(speaker.peer, r);
  if (held != nullptr && held->arrived.round.variant <= r.variant) return Action::kDrop;
  // A round whose policy is not registered here can still be served: the first copy wins.
  const Merge merge =
      policy == nullptr ? Merge::kDeliver : policy->merge({r.variant, r.best_planned, r.degraded});
  if (merge == Merge::kDeliver) return Action::kServe;
  guard::StageGuard::Hold hold = guard.hold(now, r.stage_end(r.stage), clock, r.stage == r.stages);
  strike_long_deadline(r);
  TimePoint longest = saturating_add(now, bounded_deadline(r));
  // The application gets its answer by the end-to-end deadline.
  if (is_own(r) && r.stage == r.stages) {
    longest = std::min(longest, when_elapsed(r.t0, r.qos.deadline));
  }
  if (hold.until > longest) {
    hold.until = longest;
    hold.is_stage_deadline = false;
  }
  if (hold.until <= now) return Action::kServe;
  held_.drop(speaker.peer, r);
  const std::size_t most = scaled(limits_.held_messages, speaker);
  if (!held_.has_room(speaker.peer, arrived.payload.size(), most)) {
    strike(PeerLimit::kHeldMessages);
    return Action::kServe;
  }
  held_.add({std::move(arrived), hold});
  return Action::kHold;
}

void Stages::finish(PeerId peer, const dispatch::Round& round) {
  if (Served* stages = served(peer, round)) *stages |= 1U << round.stage;
  // What a round of ours comes back to may have come from several peers.
  if (is_own(round)) {
    held_.drop(round);
  } else {
    held_.drop(peer, round);
  }
}

Delivered Stages::serve(TimePoint now, const Speaker& speaker, Arrived arrived,
                        const Verdict& verdict) {
  const dispatch::Round& r = arrived.round;
  strike_long_deadline(r);
  const Duration deadline = bounded_deadline(r);
  finish(speaker.peer, r);
  RoundContext context{.round = r,
                       .from = arrived.from,
                       .by_relay = speaker.is_relay,
                       .stage = r.stage,
                       .verdict = verdict,
                       .began = now};
  const PeerId owner = this->owner(speaker.peer, r);
  const std::size_t most = owner == kOurselves ? kOwnContexts : scaled(limits_.contexts, speaker);
  // What hands over late is still learnt from.
  if (!contexts_.open(now, owner, r.ref, std::move(context), now + 2 * deadline, most) &&
      owner != kOurselves) {
    strike(PeerLimit::kContexts);
  }
  Delivered delivered{.round = r.ref,
                      .from = arrived.from,
                      .stage = r.stage,
                      .variant = r.variant,
                      .degraded = r.degraded,
                      .verdict = verdict,
                      .deadline = deadline,
                      .qos = r.qos,
                      .payload = std::move(arrived.payload)};
  delivered.qos.deadline = deadline;
  return delivered;
}

void Stages::open(TimePoint now, RoundContext context) {
  const RoundRef round = context.round.ref;
  const TimePoint expires = now + 2 * context.round.qos.deadline;
  contexts_.open(now, kOurselves, round, std::move(context), expires, kOwnContexts);
}

void Stages::strike(PeerLimit limit) {
  if (std::ranges::find(struck_, limit) == struck_.end()) struck_.push_back(limit);
}

Stages::Struck Stages::take_struck() { return std::exchange(struck_, {}); }

void Stages::fill(PeerId peer, PeerLedger& ledger) const {
  for (auto it = pipelines_.lower_bound({peer, {}, {}});
       it != pipelines_.end() && it->first.peer == peer; ++it) {
    ++ledger.pipelines;
  }
  ledger.contexts = contexts_.count(peer);
}

}  // namespace interneuron::rounds
