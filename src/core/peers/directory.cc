#include "core/peers/peer_table.h"

#include <algorithm>

namespace interneuron::peers {
namespace {

// Spreads a seed over 64 bits; the next value of SplitMix64 ("Fast Splittable Pseudorandom Number
// Generators", Steele et al.).
std::uint64_t next_random(std::uint64_t& state) {
  state += 0x9e3779b97f4a7c15;
  std::uint64_t z = state;
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111eb;
  return z ^ (z >> 31U);
}

template <class Map, class Where>
void erase_one(Map& map, const Where& where, Directory::Slot peer) {
  const auto [first, last] = map.equal_range(where);
  const auto it = std::find_if(first, last, [peer](const auto& e) { return e.second == peer; });
  if (it != last) map.erase(it);
}

}  // namespace

Directory::Hash::Hash(std::uint64_t seed)
    : multiplier(next_random(seed) | 1U), offset(next_random(seed)) {}

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
