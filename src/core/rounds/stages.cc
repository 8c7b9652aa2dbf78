#include "core/rounds/stages.h"

#include <algorithm>

#include "core/base/earliest.h"
#include "core/rounds/round_terms.h"

namespace interneuron {
namespace {

bool same_stage(const wire::RoundHeader& a, const wire::RoundHeader& b) {
  return a.round == b.round && a.stage == b.stage;
}

}  // namespace

bool Previewed::fits(std::size_t count, std::span<const LinkState> links) const {
  return count == variants && std::ranges::all_of(plan.sends, [links](const Assignment& a) {
           return std::ranges::any_of(
               links, [&a](const LinkState& link) { return link.up && link.id == a.link; });
         });
}

guard::StageGuard& Stages::observer(const wire::RoundHeader& header, PeerId via) {
  const Key key{header.round.origin, header.round.pipeline};
  if (!observers_.contains(key) && observers_.size() >= most_) {
    const auto oldest = std::ranges::min_element(
        observers_, {}, [](const auto& entry) { return entry.second.used; });
    served_.erase(oldest->first);
    observers_.erase(oldest);
  }
  Observed& observed = observers_[key];
  if (!observed.guard || observed.kind != header.guard) {
    observed.guard = guard::make_stage_guard(header.guard, false);
    observed.kind = header.guard;
  }
  observed.via = via;
  observed.used = ++uses_;
  return *observed.guard;
}

void Stages::forget_clock(PeerId via) {
  for (auto& [key, observed] : observers_) {
    if (observed.via == via) observed.guard->reset();
  }
}

// Nothing when the round is so old that its slot belongs to a younger one.
Stages::Served* Stages::served(const wire::RoundHeader& header) {
  return served_[{header.round.origin, header.round.pipeline}].enter(header.round.round);
}

Stages::Action Stages::arrive(TimePoint now, Arrived& arrived, const Policy* policy,
                              const ClockOf& clock, guard::StageGuard& observer) {
  const wire::RoundHeader& h = arrived.header;
  observer.note_arrival(now, stage_end(h, h.stage));
  const Served* stages = served(h);
  if (stages == nullptr || ((*stages >> h.stage) & 1U) != 0) return Action::kDrop;
  const auto held = std::ranges::find_if(
      held_, [&h](const Released& r) { return same_stage(r.arrived.header, h); });
  if (held != held_.end() && held->arrived.header.variant <= h.variant) return Action::kDrop;
  // A round whose policy is not registered here can still be served: the first copy wins.
  const Merge merge =
      policy == nullptr ? Merge::kDeliver : policy->merge({h.variant, h.best_planned, h.degraded});
  if (merge == Merge::kDeliver || held_is_full(arrived.payload.size())) return Action::kServe;
  const guard::StageGuard::Hold hold =
      observer.hold(now, stage_end(h, h.stage), clock, h.stage == h.stages);
  if (hold.until <= now) return Action::kServe;
  if (held != held_.end()) held_.erase(held);
  held_.push_back({std::move(arrived), hold});
  return Action::kHold;
}

bool Stages::held_is_full(std::size_t further_bytes) const {
  std::size_t bytes = further_bytes;
  for (const Released& r : held_) bytes += r.arrived.payload.size();
  return held_.size() >= most_ || bytes > kMaxHeldBytes;
}

void Stages::finish(const wire::RoundHeader& header) {
  if (Served* stages = served(header)) *stages |= 1U << header.stage;
  drop_held(header);
}

void Stages::drop_held(const wire::RoundHeader& header) {
  std::erase_if(held_, [&](const Released& r) { return same_stage(r.arrived.header, header); });
}

Delivered Stages::serve(TimePoint now, Arrived arrived, const ClockOf& clock,
                        guard::StageGuard& observer) {
  const Verdict verdict =
      observer.end_stage(now, stage_end(arrived.header, arrived.header.stage), clock);
  return deliver(now, std::move(arrived), verdict);
}

Delivered Stages::serve_held(Released released, guard::StageGuard& observer) {
  const Verdict verdict = observer.end_stage_held(
      stage_end(released.arrived.header, released.arrived.header.stage), released.hold);
  return deliver(released.hold.until, std::move(released.arrived), verdict);
}

Delivered Stages::deliver(TimePoint now, Arrived arrived, const Verdict& verdict) {
  const wire::RoundHeader& h = arrived.header;
  finish(h);
  RoundContext context;
  context.header = h;
  context.from = arrived.from;
  context.stage = h.stage;
  context.verdict = verdict;
  context.began = now;
  open(now, h.round, std::move(context), h.deadline());
  Delivered delivered;
  delivered.round = h.round;
  delivered.from = arrived.from;
  delivered.stage = h.stage;
  delivered.variant = h.variant;
  delivered.degraded = h.degraded;
  delivered.verdict = verdict;
  delivered.deadline = h.deadline();
  delivered.qos = qos_of(h);
  delivered.payload = std::move(arrived.payload);
  return delivered;
}

std::vector<Stages::Released> Stages::release(TimePoint now) {
  std::vector<Released> due;
  for (Released& r : held_) {
    if (r.hold.until <= now) due.push_back(std::move(r));
  }
  std::erase_if(held_, [now](const Released& r) { return r.hold.until <= now; });
  std::ranges::stable_sort(due, {}, [](const Released& r) { return r.hold.until; });
  return due;
}

std::optional<TimePoint> Stages::next_timeout() const {
  std::optional<TimePoint> next;
  for (const Released& r : held_) next = earliest(next, r.hold.until);
  return next;
}

RoundContext* Stages::context(const RoundRef& round) {
  const auto it = contexts_.find(round);
  return it == contexts_.end() ? nullptr : &it->second.context;
}

bool Stages::has_served(const RoundRef& round) const {
  const auto it = served_.find({round.origin, round.pipeline});
  if (it == served_.end()) return false;
  const Served* stages = it->second.find(round.round);
  return stages != nullptr && *stages != 0;
}

void Stages::open(TimePoint now, const RoundRef& round, RoundContext context, Duration deadline) {
  while (!expiries_.empty() && expiries_.begin()->first < now) close(expiries_.begin()->second);
  if (contexts_.size() >= kContexts * most_) close(contexts_.begin()->first);
  close(round);
  // What hands over late is still learnt from.
  const TimePoint expires = now + 2 * deadline;
  contexts_.emplace(round, Opened{std::move(context), expires});
  expiries_.emplace(expires, round);
}

void Stages::close(RoundRef round) {
  const auto it = contexts_.find(round);
  if (it == contexts_.end()) return;
  expiries_.erase({it->second.expires, round});
  contexts_.erase(it);
}

}  // namespace interneuron
