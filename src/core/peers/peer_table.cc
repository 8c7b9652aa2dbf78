#include "core/peers/peer_table.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

#include "core/peers/address_validation.h"

namespace interneuron::peers {

PeerEntry& PeerTable::add(Peer::Identity identity, TimePoint now) {
  if (free_.empty()) {
    free_.push_back(static_cast<Slot>(entries_.size()));
    entries_.emplace_back();
  }
  const Slot slot = free_.back();
  free_.pop_back();
  identity.id = PeerId{std::exchange(next_, next_ + step_)};
  entries_[slot] = std::make_unique<PeerEntry>(slot, identity, now);
  by_id_.emplace(identity.id, slot);
  directory_.add_session(identity.session, slot);
  return *entries_[slot];
}

// Addresses are not listed of peers that came unannounced, and no others are ever removed.
void PeerTable::remove(const PeerEntry& entry) {
  const Slot slot = entry.slot;
  directory_.remove_session(entry.peer.identity().session, slot);
  by_id_.erase(entry.peer.identity().id);
  entries_[slot].reset();
  free_.push_back(slot);
}

void PeerTable::change_session(const PeerEntry& entry, SessionId to) {
  const SessionId before = entry.peer.identity().session;
  directory_.retire(before);
  directory_.remove_session(before, entry.slot);
  directory_.add_session(to, entry.slot);
}

PeerEntry* PeerTable::find(PeerId id) {
  const auto it = by_id_.find(id);
  return it == by_id_.end() ? nullptr : entries_[it->second].get();
}

const PeerEntry* PeerTable::find(PeerId id) const {
  const auto it = by_id_.find(id);
  return it == by_id_.end() ? nullptr : entries_[it->second].get();
}

PeerEntry* PeerTable::only() {
  return by_id_.size() == 1 ? entries_[by_id_.begin()->second].get() : nullptr;
}

std::vector<PeerId> PeerTable::ids() const {
  std::vector<PeerId> out;
  for (const auto& [id, slot] : by_id_) out.push_back(id);
  std::ranges::sort(out);
  return out;
}

// Several have one session where we have connected again to a peer whose links we had lost: it is
// then the first that came unannounced or has the path.
PeerEntry* PeerTable::of_session(const wire::PacketHeader& header) {
  PeerEntry* found = nullptr;
  directory_.for_each(header.session, [&](Slot slot) {
    PeerEntry& entry = *entries_[slot];
    const Peer::Identity& identity = entry.peer.identity();
    if (identity.connected && !entry.peer.paths().has(header.link)) return;
    if (found == nullptr || identity.id < found->peer.identity().id) found = &entry;
  });
  return found;
}

PeerEntry* PeerTable::of_address(const wire::PacketHeader& header, const Datagram& datagram) {
  PeerEntry* found = nullptr;
  for_each_at(datagram.link, datagram.from, [&](PeerEntry& entry) {
    const Peer::Identity& identity = entry.peer.identity();
    if (identity.session == header.session || !entry.peer.paths().has(header.link)) return;
    if (found == nullptr || identity.id < found->peer.identity().id) found = &entry;
  });
  return found;
}

void PeerTable::list_addresses(const PeerEntry& entry) {
  if (!entry.peer.identity().connected) return;
  for (const Path& path : entry.peer.paths()) {
    directory_.add_address(path.nic().link, path.address(), entry.slot);
  }
}

void PeerTable::unlist_addresses(const PeerEntry& entry) {
  if (!entry.peer.identity().connected) return;
  for (const Path& path : entry.peer.paths()) {
    directory_.remove_address(path.nic().link, path.address(), entry.slot);
  }
}

// First go those that have never heard us, of which whoever answers challenges alone may have many;
// but for kJoinTime not for one whose host has more places. Then who was silent for kPeerPause;
// then the youngest of a host that has two places more than the newcomer's, or of one with as many
// whose network has two more. So whoever takes many places makes room for those who take few, and
// not the other way round.
PeerEntry* PeerTable::makes_room(TimePoint now, const Address& from) {
  std::map<Network, std::size_t> networks;
  std::map<Network, std::size_t> hosts;
  for_each([&](const PeerEntry& entry) {
    if (entry.peer.identity().connected) return;
    ++networks[network_of(entry.first_seen_at)];
    ++hosts[host_of(entry.first_seen_at)];
  });
  using Crowd = std::pair<std::size_t, std::size_t>;
  const auto crowd = [&](const Address& at) {
    return Crowd{networks[network_of(at)], hosts[host_of(at)]};
  };
  const Crowd own = crowd(from);
  // What counts more comes first: the kind of reason, how strong it is, and which of those that are
  // alike otherwise.
  using Reason = std::tuple<int, Crowd, std::int64_t>;
  std::optional<std::pair<Reason, PeerEntry*>> best;
  for (const auto& [id, slot] : by_id_) {
    PeerEntry& entry = *entries_[slot];
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
  return best ? best->second : nullptr;
}

}  // namespace interneuron::peers
