#include "app/computing/shares.h"

#include <algorithm>

namespace interneuron::computing {

void FairTurns::want(PeerId peer) {
  Account& account = accounts_[peer];
  if (account.since != 0) return;
  account.since = ++calls_;
  account.served = std::max(account.served, reached_);
  order_.insert(place(peer, account));
}

void FairTurns::rest(PeerId peer) {
  const auto found = accounts_.find(peer);
  if (found == accounts_.end() || found->second.since == 0) return;
  order_.erase(place(peer, found->second));
  found->second.since = 0;
}

void FairTurns::forget(PeerId peer) {
  rest(peer);
  accounts_.erase(peer);
}

std::optional<PeerId> FairTurns::next() const {
  if (order_.empty()) return std::nullopt;
  return std::get<PeerId>(*order_.begin());
}

void FairTurns::begin(PeerId peer) {
  const auto found = accounts_.find(peer);
  if (found != accounts_.end()) reached_ = std::max(reached_, found->second.served);
}

void FairTurns::charge(PeerId peer, Duration took) {
  const auto found = accounts_.find(peer);
  if (found == accounts_.end()) return;
  Account& account = found->second;
  const bool wants = account.since != 0;
  if (wants) order_.erase(place(peer, account));
  account.served += std::max(took, Duration{});
  if (wants) order_.insert(place(peer, account));
}

void ShareOfTime::came(PeerId peer, TimePoint now) {
  const auto [entry, is_new] = peers_.try_emplace(peer);
  Arrivals& arrivals = entry->second;
  if (!is_new) {
    const Duration since = std::clamp(now - arrivals.last, Duration{}, kActive);
    const Duration before = arrivals.interval.value_or(since);
    arrivals.interval = before + (since - before) / kSmoothing;
    active_.erase({arrivals.last, peer});
  }
  arrivals.last = now;
  active_.emplace(now, peer);
}

void ShareOfTime::forget(PeerId peer) {
  const auto found = peers_.find(peer);
  if (found == peers_.end()) return;
  active_.erase({found->second.last, peer});
  peers_.erase(found);
}

std::size_t ShareOfTime::active(TimePoint now) {
  while (!active_.empty() && now - active_.begin()->first > kActive) {
    active_.erase(active_.begin());
  }
  return active_.size();
}

Duration ShareOfTime::longest(PeerId peer, TimePoint now) {
  const auto found = peers_.find(peer);
  const std::size_t peers = active(now);
  if (peers < 2 || found == peers_.end() || !found->second.interval) return Duration::max();
  return *found->second.interval / static_cast<Duration::rep>(peers);
}

}  // namespace interneuron::computing
