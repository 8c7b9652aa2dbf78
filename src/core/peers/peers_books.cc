// What is counted and kept of the peers of an endpoint, for those who ask.
#include "core/peers/peers.h"

namespace interneuron {

PeerLedger Peers::ledger(PeerId id) const {
  const auto it = by_id_.find(id);
  return it == by_id_.end() ? PeerLedger{} : entries_[it->second]->peer.ledger();
}

LinkCounters Peers::counters(LinkId link) const {
  const auto it = links_.find(link);
  if (it == links_.end()) return {};
  LinkCounters out = it->second.counters;
  for (const auto& [id, key] : by_id_) {
    const Peer::Repairs repairs = entries_[key]->peer.repairs(link);
    out.fragments_resent += repairs.resent;
    out.symbols_sent += repairs.symbols;
    out.fragments_lost += repairs.lost;
  }
  return out;
}

std::uint64_t Peers::cancelled() const {
  std::uint64_t sum = 0;
  for (const auto& [id, key] : by_id_) sum += entries_[key]->peer.cancelled();
  return sum;
}

}  // namespace interneuron
