#include "core/peers/peer_table.h"

#include <algorithm>

#include "core/base/split_mix.h"

namespace interneuron::peers {
namespace {

template <class Map, class Where>
void erase_one(Map& map, const Where& where, Directory::Slot peer) {
  const auto [first, last] = map.equal_range(where);
  const auto it = std::find_if(first, last, [peer](const auto& e) { return e.second == peer; });
  if (it != last) map.erase(it);
}

}  // namespace

Directory::Hash::Hash(std::uint64_t seed)
    : multiplier(next_split_mix(seed) | 1U), offset(next_split_mix(seed)) {}

void Directory::add_session(SessionId session, Slot peer) {
  if (session.value != 0) sessions_.emplace(session, peer);
}

void Directory::remove_session(SessionId session, Slot peer) {
  erase_one(sessions_, session, peer);
}

void Directory::add_address(LinkId nic, const Address& address, Slot peer) {
  addresses_.emplace(place_of(nic, address), peer);
}

void Directory::remove_address(LinkId nic, const Address& address, Slot peer) {
  erase_one(addresses_, place_of(nic, address), peer);
}

void Directory::retire(SessionId session) {
  if (session.value == 0 || !retired_.insert(session).second) return;
  retired_order_.push_back(session);
  if (retired_order_.size() <= kRetired) return;
  retired_.erase(retired_order_.front());
  retired_order_.pop_front();
}

}  // namespace interneuron::peers
