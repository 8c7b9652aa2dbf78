#include "core/rounds/kept_rounds.h"

#include <algorithm>

namespace interneuron::rounds {
namespace {

bool same_stage(const dispatch::Round& a, const dispatch::Round& b) {
  return a.ref == b.ref && a.stage == b.stage;
}

}  // namespace

const Held* HeldVariants::find(PeerId peer, const dispatch::Round& round) const {
  const auto of = peers_.find(peer);
  if (of == peers_.end()) return nullptr;
  for (const Key& key : of->second) {
    const Held& held = waiting_.at(key);
    if (same_stage(held.arrived.round, round)) return &held;
  }
  return nullptr;
}

void HeldVariants::add(Held held) {
  memory_.add(held.arrived.from, held.arrived.payload.size());
  const Key key{held.hold.until, ++added_};
  peers_[held.arrived.from].push_back(key);
  waiting_.emplace(key, std::move(held));
}

Held HeldVariants::take(Waiting::iterator it) {
  const auto of = peers_.find(it->second.arrived.from);
  memory_.remove(of->first, it->second.arrived.payload.size());
  std::erase(of->second, it->first);
  if (of->second.empty()) peers_.erase(of);
  Held held = std::move(it->second);
  waiting_.erase(it);
  return held;
}

template <class Which>
void HeldVariants::drop_of(PeerId peer, const Which& which) {
  const auto of = peers_.find(peer);
  if (of == peers_.end()) return;
  const std::vector<Key> keys = of->second;
  for (const Key& key : keys) {
    const auto it = waiting_.find(key);
    if (which(it->second)) take(it);
  }
}

void HeldVariants::drop(PeerId peer, const dispatch::Round& round) {
  drop_of(peer, [&round](const Held& held) { return same_stage(held.arrived.round, round); });
}

void HeldVariants::forget(PeerId peer) {
  drop_of(peer, [](const Held&) { return true; });
}

void HeldVariants::drop(const dispatch::Round& round) {
  for (auto it = waiting_.begin(); it != waiting_.end();) {
    const auto next = std::next(it);
    if (same_stage(it->second.arrived.round, round)) take(it);
    it = next;
  }
}

std::vector<Held> HeldVariants::release(TimePoint now) {
  std::vector<Held> due;
  while (!waiting_.empty() && waiting_.begin()->first.first <= now) {
    due.push_back(take(waiting_.begin()));
  }
  return due;
}

std::optional<TimePoint> HeldVariants::next_timeout() const {
  if (waiting_.empty()) return std::nullopt;
  return waiting_.begin()->first.first;
}

}  // namespace interneuron::rounds
