// The places of peers that come unannounced: who is given one, and who makes room where none is
// left.
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "core/peers/peers.h"

namespace interneuron {

Peers::Entry* Peers::accept(TimePoint now, const wire::PacketHeader& header,
                            const Datagram& datagram) {
  if (!options_.accept) return nullptr;
  if (unannounced_ >= options_.max_unannounced && !make_room(now, datagram.from)) return nullptr;
  Entry& entry = add(now, header.session, false);
  entry.first_seen_at = datagram.from;
  entry.peer.add_path(now, header.link, nic(datagram.link), datagram.from);
  return &entry;
}

// Takes the place of a peer away, for one that comes from there. First go those that have never
// heard us, of which whoever answers challenges alone may have many; but for kJoinTime not for one
// whose host has more places. Then who was silent for kPeerPause; then the youngest of a host that
// has two places more than the newcomer's, or of one with as many whose network has two more. So
// whoever takes many places makes room for those who take few, and not the other way round.
bool Peers::make_room(TimePoint now, const Address& from) {
  std::map<Network, std::size_t> networks;
  std::map<Network, std::size_t> hosts;
  for (const auto& [id, key] : by_id_) {
    const Entry& entry = *entries_[key];
    if (entry.peer.identity().connected) continue;
    ++networks[network_of(entry.first_seen_at)];
    ++hosts[host_of(entry.first_seen_at)];
  }
  using Crowd = std::pair<std::size_t, std::size_t>;
  const auto crowd = [&](const Address& at) {
    return Crowd{networks[network_of(at)], hosts[host_of(at)]};
  };
  const Crowd own = crowd(from);
  // What counts more comes first: the kind of reason, how strong it is, and which of those that are
  // alike otherwise.
  using Reason = std::tuple<int, Crowd, std::int64_t>;
  std::optional<std::pair<Reason, Entry*>> best;
  for (const auto& [id, key] : by_id_) {
    Entry& entry = *entries_[key];
    const Peer& peer = entry.peer;
    if (peer.identity().connected) continue;
    const Crowd of = crowd(entry.first_seen_at);
    const auto age = std::int64_t{id.value};
    Reason reason;
    const bool is_joining = now - entry.added_at < kJoinTime && of.second < own.second;
    if (!peer.ready() && !is_joining) {
      reason = {3, of, -age};
    } else if (now - peer.heard_at() >= kPeerPause) {
      reason = {2, {}, (now - peer.heard_at()).count()};
    } else if (of.second >= own.second + 2 ||
               (of.first >= own.first + 2 && of.second >= own.second)) {
      reason = {1, of, age};
    } else {
      continue;
    }
    if (!best || reason > best->first) best = {reason, &entry};
  }
  if (!best) return false;
  forget(*best->second);
  return true;
}

}  // namespace interneuron
