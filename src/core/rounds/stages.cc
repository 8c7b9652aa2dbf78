#include "core/rounds/stages.h"

#include <algorithm>

#include "core/rounds/round_terms.h"

namespace interneuron {

guard::StageGuard& Stages::observer(const wire::RoundHeader& header, const Sender& sender) {
  Pipeline& found = pipeline(header, sender);
  if (!found.guard || found.kind != header.guard) {
    found.guard = guard::make_stage_guard(header.guard, false, ablation_);
    found.kind = header.guard;
  }
  return *found.guard;
}

Stages::Pipeline& Stages::pipeline(const wire::RoundHeader& header, const Sender& sender) {
  const Key key{owner(sender.peer, header), header.round.origin, header.round.pipeline};
  auto it = pipelines_.find(key);
  if (it == pipelines_.end()) {
    if (!is_own(header)) make_room_for_pipeline(sender);
    it = pipelines_.try_emplace(key).first;
  }
  it->second.used = ++uses_;
  return it->second;
}

// The peer's own that was least recently used goes where it has as many as it may.
void Stages::make_room_for_pipeline(const Sender& sender) {
  const auto first = pipelines_.lower_bound({sender.peer, {}, {}});
  auto oldest = first;
  std::size_t count = 0;
  for (auto it = first; it != pipelines_.end() && it->first.peer == sender.peer; ++it) {
    ++count;
    if (it->second.used < oldest->second.used) oldest = it;
  }
  if (count < scaled(limits_.pipelines, sender)) return;
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
Stages::Served* Stages::served(PeerId peer, const wire::RoundHeader& header) {
  const auto it =
      pipelines_.find({owner(peer, header), header.round.origin, header.round.pipeline});
  return it == pipelines_.end() ? nullptr : it->second.served.enter(header.round.round);
}

bool Stages::has_served(const RoundRef& round) const {
  return std::ranges::any_of(pipelines_, [&round](const auto& entry) {
    if (entry.first.origin != round.origin || entry.first.pipeline != round.pipeline) return false;
    const Served* stages = entry.second.served.find(round.round);
    return stages != nullptr && *stages != 0;
  });
}

Duration Stages::believed(const wire::RoundHeader& header) {
  if (is_own(header) || header.deadline() <= limits_.longest_deadline) return header.deadline();
  strike(PeerLimit::kDeadline);
  return limits_.longest_deadline;
}

Stages::Action Stages::arrive(TimePoint now, const Sender& sender, Arrived& arrived,
                              const Policy* policy, const ClockOf& clock,
                              guard::StageGuard& observer) {
  const wire::RoundHeader& h = arrived.header;
  observer.note_arrival(now, stage_end(h, h.stage));
  // The guard of a round that began here lies elsewhere, so that its pipeline may be new here.
  if (is_own(h)) pipeline(h, sender);
  const Served* stages = served(sender.peer, h);
  if (stages == nullptr || ((*stages >> h.stage) & 1U) != 0) return Action::kDrop;
  const Held* held = held_.find(sender.peer, h);
  if (held != nullptr && held->arrived.header.variant <= h.variant) return Action::kDrop;
  // A round whose policy is not registered here can still be served: the first copy wins.
  const Merge merge =
      policy == nullptr ? Merge::kDeliver : policy->merge({h.variant, h.best_planned, h.degraded});
  if (merge == Merge::kDeliver) return Action::kServe;
  guard::StageGuard::Hold hold =
      observer.hold(now, stage_end(h, h.stage), clock, h.stage == h.stages);
  TimePoint longest = saturating_add(now, believed(h));
  // The application gets its answer by the end-to-end deadline.
  if (is_own(h) && h.stage == h.stages) {
    longest = std::min(longest, when_elapsed(h.t0, h.deadline()));
  }
  if (hold.until > longest) {
    hold.until = longest;
    hold.is_stage_deadline = false;
  }
  if (hold.until <= now) return Action::kServe;
  held_.drop(sender.peer, h);
  const std::size_t most = scaled(limits_.held_messages, sender);
  if (!held_.has_room(sender.peer, arrived.payload.size(), most)) {
    strike(PeerLimit::kHeldMessages);
    return Action::kServe;
  }
  held_.add({std::move(arrived), hold});
  return Action::kHold;
}

void Stages::finish(PeerId peer, const wire::RoundHeader& header) {
  if (Served* stages = served(peer, header)) *stages |= 1U << header.stage;
  // What a round of ours comes back to may have come from several peers.
  if (is_own(header)) {
    held_.drop(header);
  } else {
    held_.drop(peer, header);
  }
}

Delivered Stages::serve(TimePoint now, const Sender& sender, Arrived arrived, const ClockOf& clock,
                        guard::StageGuard& observer) {
  const Verdict verdict =
      observer.end_stage(now, stage_end(arrived.header, arrived.header.stage), clock);
  return deliver(now, sender, std::move(arrived), verdict);
}

Delivered Stages::serve_held(const Sender& sender, Held released, guard::StageGuard& observer) {
  const Verdict verdict = observer.end_stage_held(
      stage_end(released.arrived.header, released.arrived.header.stage), released.hold);
  return deliver(released.hold.until, sender, std::move(released.arrived), verdict);
}

Delivered Stages::deliver(TimePoint now, const Sender& sender, Arrived arrived,
                          const Verdict& verdict) {
  const wire::RoundHeader& h = arrived.header;
  const Duration deadline = believed(h);
  finish(sender.peer, h);
  RoundContext context;
  context.header = h;
  context.from = arrived.from;
  context.by_relay = sender.is_relay;
  context.stage = h.stage;
  context.verdict = verdict;
  context.began = now;
  const PeerId owner = this->owner(sender.peer, h);
  const std::size_t most = owner == kOurselves ? kOwnContexts : scaled(limits_.contexts, sender);
  // What hands over late is still learnt from.
  if (!contexts_.open(now, owner, h.round, std::move(context), now + 2 * deadline, most) &&
      owner != kOurselves) {
    strike(PeerLimit::kContexts);
  }
  Delivered delivered;
  delivered.round = h.round;
  delivered.from = arrived.from;
  delivered.stage = h.stage;
  delivered.variant = h.variant;
  delivered.degraded = h.degraded;
  delivered.verdict = verdict;
  delivered.qos = qos_of(h);
  delivered.deadline = delivered.qos.deadline = deadline;
  delivered.payload = std::move(arrived.payload);
  return delivered;
}

void Stages::open(TimePoint now, RoundContext context) {
  const RoundRef round = context.header.round;
  const TimePoint expires = now + 2 * context.header.deadline();
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
  ledger.held_messages = held_.count(peer);
  ledger.held_bytes = held_.bytes(peer);
}

}  // namespace interneuron
