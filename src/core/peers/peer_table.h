// The peers of an endpoint: the index of their sessions and addresses (Directory), and their places
// (PeerTable).
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "core/peers/peer.h"
#include "interneuron/address.h"
#include "interneuron/units.h"

namespace interneuron::peers {

// Who is meant by a session, and who was reached at an address: the index of an endpoint's peers.
//
// Peers are known by small dense numbers, as in Alarms. Sessions are chosen by the peers, so that
// an attacker could pick ones that all fall into one bucket of a known hash and make every lookup a
// scan. So the hash is multiply-shift with a multiplier drawn from a secret seed ("A Reliable
// Randomized Algorithm for the Closest-Pair Problem", Dietzfelbinger et al.): two sessions chosen
// without the seed meet with a chance of about 2 in the number of buckets. Addresses are those that
// this side was told to connect to; nobody else chooses them, and an ordered map serves. Memory is
// bounded by the peers there are and kRetired. Owned and fed by PeerTable. Pure; thread-compatible.
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

// An unannounced peer that was silent for this long is forgotten; its reference times are forgotten
// after the same time (docs/paper.md, "Clock steps").
inline constexpr Duration kPeerSilence = std::chrono::seconds(60);
// One that was silent for this long makes room for another one where there is no room: longer than
// the rarest heartbeats are apart (link::ProbeSchedule::kMeteredHeartbeat).
inline constexpr Duration kPeerPause = std::chrono::seconds(15);
// For so long one that has proved its address has time to hear us and to show it, before others of
// hosts with more places may take its place. No measurement behind this value: it only has to be
// longer than some round trips with losses.
inline constexpr Duration kJoinTime = std::chrono::seconds(2);

// A peer in its place.
struct PeerEntry {
  PeerEntry(std::uint32_t at, const Peer::Identity& identity, TimePoint now)
      : slot(at), added_at(now), peer(identity, now) {}
  std::uint32_t slot = 0;
  TimePoint added_at{};
  // Where the first packet of a peer that came unannounced came from.
  Address first_seen_at{};
  // Something has happened since the peer's alarm was set.
  bool touched = false;
  // How many paths of the try under way an initiation has left over.
  std::size_t initiations = 0;
  // What the books of all peers (SharedMemory) know that this one holds.
  std::size_t reassembly_bytes = 0;
  std::size_t sending_bytes = 0;
  Peer peer;
};

// The peers of an endpoint by their places: who is there, whose a session is, who was reached at an
// address, and who makes room where no place is left.
//
// A peer keeps its place (Slot) as long as it is there; a place that is free is given to the next
// one, so that places are small dense numbers, by which Gate, Alarms and Turns know peers too.
// Owned by Peers, which decides who comes and who goes. Sessions are anybody's choice (Directory).
// Memory is that of the most peers there ever were at a time. Pure; thread-compatible.
class PeerTable {
 public:
  using Slot = std::uint32_t;

  // `seed`: see Directory. `shard`: which peers are named here.
  explicit PeerTable(std::uint64_t seed, const Shard& shard = {})
      : directory_(seed), next_(std::max<std::uint32_t>(shard.index, 1)) {
    if (shard.count > 0) step_ = shard.count;
  }

  // Adds a peer; its identifier is given here.
  PeerEntry& add(Peer::Identity identity, TimePoint now);
  void remove(const PeerEntry& entry);
  // What is known of this peer begins with another session; nobody is served under the old one.
  void change_session(const PeerEntry& entry, SessionId to);

  // There is a peer in this place.
  PeerEntry& at(Slot slot) { return *entries_[slot]; }
  const PeerEntry& at(Slot slot) const { return *entries_[slot]; }
  PeerEntry* find(PeerId id);
  const PeerEntry* find(PeerId id) const;
  // The only peer there is, else nullptr.
  PeerEntry* only();
  // In ascending order.
  std::vector<PeerId> ids() const;
  // Calls visit(Entry) for every peer, in no particular order.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (const auto& [id, slot] : by_id_) visit(std::as_const(*entries_[slot]));
  }

  // Packets of this session are those of a peer that has begun another one, and come late.
  bool is_retired(SessionId session) const { return directory_.is_retired(session); }
  // The peer of the session of this packet.
  PeerEntry* of_session(const wire::PacketHeader& header);
  // The first peer that we connected to at the address that this packet came from, of those that
  // have another session.
  PeerEntry* of_address(const wire::PacketHeader& header, const Datagram& datagram);
  // Calls visit(Entry) for every peer that we connected to at this address.
  template <class Visit>
  void for_each_at(LinkId nic, const Address& address, const Visit& visit) {
    directory_.for_each(nic, address, [&](Slot slot) { visit(*entries_[slot]); });
  }
  // Adds the addresses of a peer that we connect to, or takes them away while its paths change.
  void list_addresses(const PeerEntry& entry);
  void unlist_addresses(const PeerEntry& entry);

  // Who makes room for one that comes from there; nullptr: nobody.
  PeerEntry* makes_room(TimePoint now, const Address& from);

 private:
  // A place of a peer that is gone is empty and listed in free_.
  std::vector<std::unique_ptr<PeerEntry>> entries_;
  std::vector<Slot> free_;
  std::unordered_map<PeerId, Slot> by_id_;
  Directory directory_;
  // The next peer's identifier, and how far they are apart.
  std::uint32_t next_ = 1;
  std::uint32_t step_ = 1;
};

}  // namespace interneuron::peers
