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
  for (const Key& key : of->second.keys) {
    const Held& held = waiting_.at(key);
    if (same_stage(held.arrived.round, round)) return &held;
  }
  return nullptr;
}

bool HeldVariants::has_room(PeerId peer, std::size_t bytes, std::size_t most) const {
  return count(peer) < most && bytes <= memory_.room(this->bytes(peer));
}

void HeldVariants::add(Held held) {
  OfPeer& of = peers_[held.arrived.from];
  const std::size_t bytes = held.arrived.payload.size();
  memory_.change(of.bytes, of.bytes + bytes);
  of.bytes += bytes;
  const Key key{held.hold.until, ++added_};
  of.keys.push_back(key);
  waiting_.emplace(key, std::move(held));
}

Held HeldVariants::take(Waiting::iterator it) {
  const auto of = peers_.find(it->second.arrived.from);
  const std::size_t bytes = it->second.arrived.payload.size();
  memory_.change(of->second.bytes, of->second.bytes - bytes);
  of->second.bytes -= bytes;
  std::erase(of->second.keys, it->first);
  if (of->second.keys.empty()) peers_.erase(of);
  Held held = std::move(it->second);
  waiting_.erase(it);
  return held;
}

template <class Which>
void HeldVariants::drop_of(PeerId peer, const Which& which) {
  const auto of = peers_.find(peer);
  if (of == peers_.end()) return;
  const std::vector<Key> keys = of->second.keys;
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

std::size_t HeldVariants::count(PeerId peer) const {
  const auto of = peers_.find(peer);
  return of == peers_.end() ? 0 : of->second.keys.size();
}

std::size_t HeldVariants::bytes(PeerId peer) const {
  const auto of = peers_.find(peer);
  return of == peers_.end() ? 0 : of->second.bytes;
}

}  // namespace interneuron::rounds
