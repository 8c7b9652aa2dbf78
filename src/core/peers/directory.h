// Who is meant by a session, and who was reached at an address: the index of an endpoint's peers.
//
// Peers are known by small dense numbers, as in Alarms. Sessions are chosen by the peers, so that
// an attacker could pick ones that all fall into one bucket of a known hash and make every lookup a
// scan. So the hash is multiply-shift with a multiplier drawn from a secret seed ("A Reliable
// Randomized Algorithm for the Closest-Pair Problem", Dietzfelbinger et al.): two sessions chosen
// without the seed meet with a chance of about 2 in the number of buckets. Addresses are those that
// this side was told to connect to; nobody else chooses them, and an ordered map serves. Memory is
// bounded by the peers there are and kRetired. Owned and fed by PeerTable. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "interneuron/address.h"
#include "interneuron/units.h"

namespace interneuron::peers {

class Directory {
 public:
  using Slot = std::uint32_t;
  // How many sessions that restarted peers had before are remembered: packets of theirs that come
  // late must not bring them back.
  static constexpr std::size_t kRetired = 64;

  explicit Directory(std::uint64_t seed) : sessions_(0, Hash(seed)), retired_(0, Hash(seed)) {}

  // The peer has this session from now on; 0 names nobody and is left out.
  void add_session(SessionId session, Slot peer);
  void remove_session(SessionId session, Slot peer);
  // Calls visit(Slot) for every peer of this session, in no particular order. There is more than
  // one where we connected twice to the same host.
  template <class Visit>
  void for_each(SessionId session, const Visit& visit) const {
    const auto [first, last] = sessions_.equal_range(session);
    for (auto it = first; it != last; ++it) visit(it->second);
  }

  void add_address(LinkId nic, const Address& address, Slot peer);
  void remove_address(LinkId nic, const Address& address, Slot peer);
  // The same for every peer that is reached over this NIC at this address.
  template <class Visit>
  void for_each(LinkId nic, const Address& address, const Visit& visit) const {
    const auto [first, last] = addresses_.equal_range(place_of(nic, address));
    for (auto it = first; it != last; ++it) visit(it->second);
  }

  // Nobody is served under this session any more, for the next kRetired retirements; 0 is left out.
  void retire(SessionId session);
  bool is_retired(SessionId session) const { return retired_.contains(session); }

 private:
  struct Hash {
    explicit Hash(std::uint64_t seed);
    std::uint64_t multiplier;
    std::uint64_t offset;
    std::size_t operator()(SessionId session) const {
      return static_cast<std::size_t>((multiplier * session.value + offset) >> 32U);
    }
  };
  using Place = std::tuple<LinkId, std::uint8_t, decltype(Address::raw)>;
  static Place place_of(LinkId nic, const Address& address) {
    return {nic, address.size, address.raw};
  }

  std::unordered_multimap<SessionId, Slot, Hash> sessions_;
  std::multimap<Place, Slot> addresses_;
  std::unordered_set<SessionId, Hash> retired_;
  // The same, oldest first.
  std::deque<SessionId> retired_order_;
};

}  // namespace interneuron::peers
