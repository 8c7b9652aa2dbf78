#include "app/computing/share_of_time.h"

#include <algorithm>

namespace interneuron::computing {

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
