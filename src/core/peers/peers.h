// The peers of an endpoint and the links over which they are reached: whose a packet is, who may
// come unannounced, who has begun a new session, who was silent for too long, whose turn it is.
//
// No call looks at every peer but those of remove_link() and the getters: Directory finds the peer
// of a packet, Alarms those with something due, Turns those with something to send. A peer's
// deadline is kept, and asked again only after something has happened to that peer. So a packet
// costs the same with a thousand peers as with one, but for the caches that they share.
//
// Owned and fed by Endpoint. Anybody may send to its ports, so the datagrams are any bytes: those
// that are malformed or of nobody that is served are counted and dropped. Unannounced peers are
// accepted only where the options say so, at most max_unannounced of them, and only at addresses
// that are proved (AddressValidation): until then an address costs no memory and gets nothing but
// challenges. Where all places are taken, whoever holds the most of them without use makes room
// (make_room()). A peer that we connected to begins a new session only with a packet that shows
// that it has heard us, and is heard only where it was connected to. In the clear sessions are not
// authenticated: who has overheard that of a vehicle can send in its name, and who forges the
// address of a peer that we connected to in that one's; but neither moves a path to where it does
// not receive nor joins from there. With Options::security (peers_sealed.cc) a packet is opened by
// the keys of a handshake before any of this, so that nobody sends in the name of anybody else.
// Pure; thread-compatible.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/base/alarms.h"
#include "core/base/shared_memory.h"
#include "core/peers/address_validation.h"
#include "core/peers/directory.h"
#include "core/peers/peer.h"
#include "core/peers/turns.h"
#include "core/probe/echo_reflector.h"
#include "core/secure/sessions.h"
#include "interneuron/endpoint.h"

namespace interneuron {

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

class Peers {
 public:
  struct Options {
    // Our session.
    SessionId self{};
    // Peers may come unannounced, and echoes are answered.
    bool accept = false;
    std::size_t max_unannounced = 0;
    // Lost pieces are sent again.
    bool repair = true;
    // When this endpoint began its session.
    TimePoint started{};
    PeerLimits limits = {};
    // Drawn at random and told to nobody; see Directory and AddressValidation.
    Secret secret{};
    // What incomplete messages of all peers may hold, in bytes.
    std::size_t reassembly_budget_bytes = 0;
    // What messages under way to all peers may hold, in bytes.
    std::size_t send_budget_bytes = 0;
    // With what packets are encrypted; nothing: they are not.
    std::shared_ptr<const Security> security{};
  };
  explicit Peers(const Options& options);

  void add_link(LinkId link, const LinkInfo& info);
  std::vector<PathChanged> remove_link(TimePoint now, LinkId link);
  // Begins to talk to a peer at these addresses, one per link. `who`: its key, where packets are
  // encrypted; by default that of the only peer that is trusted. Throws std::invalid_argument when
  // a link was not added, or the peer is not trusted or connected to already.
  PeerId connect(TimePoint now, std::span<const std::pair<LinkId, Address>> addresses,
                 const std::optional<PublicKey>& who = std::nullopt);
  // False: we have not connected to such a peer, or the link was not added.
  bool add_path(TimePoint now, PeerId peer, LinkId link, const Address& address);
  // Measures the rate of a path now. False: there is no such path.
  bool request_train(TimePoint now, PeerId peer, LinkId link);

  struct Received {
    // nullptr where there is nothing more to do: the datagram was malformed, was refused, or was an
    // echo or a challenge, which are answered by the next poll().
    Peer* peer = nullptr;
    // The datagram follows this other version of the format.
    std::optional<std::uint8_t> other_version;
    // A known peer has begun a new session with this packet.
    bool restarted = false;
    Peer::Input input;
  };
  // Parses a datagram, finds whose it is (adds, moves or restarts peers as it demands, or queues a
  // challenge), hands it to that peer, and counts it. Any bytes may come.
  Received receive(TimePoint now, const Datagram& datagram);

  // What pieces that receive() has given to this peer's windows tell of others; ask until nothing
  // comes.
  std::optional<Peer::Input> receive_computed(TimePoint now, Peer& peer) {
    if (!peer.has_computed()) return std::nullopt;
    Entry& entry = *entries_[by_id_.at(peer.identity().id)];
    touch(entry);
    auto input = peer.handle_computed(now, reassembly_.room(peer.reassembly_bytes()));
    account(entry);
    return input;
  }

  // The peer with its state as of `now`; nullptr: there is no such peer. Whoever asks may change
  // the peer until the next poll() or handle_timeout().
  Peer* find(TimePoint now, std::optional<PeerId> id);
  // The only peer there is, else nullptr.
  Peer* only(TimePoint now);

  struct Expired {
    // How many incomplete messages were given up.
    std::size_t messages = 0;
    std::vector<PathChanged> changes;
  };
  // Does what is due at or before `now`, peer by peer in the order of their deadlines.
  Expired handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout(TimePoint now) const;
  struct Lost {
    PeerId id{};
    // The application may have been told of it.
    bool was_known = false;
  };
  // Unannounced peers that are forgotten: they were silent for kPeerSilence, have no path left or
  // made room for another one. Ask until nothing comes.
  std::optional<Lost> poll_lost();
  // Writes the next datagram that may leave now into `buffer` of at least kMaxDatagramBytes: what
  // answers echoes and asks addresses to prove themselves, then feedback, then data and probes in
  // turns.
  std::optional<TransmitParts> poll(TimePoint now, std::span<std::byte> buffer);

  // A complete message of a peer that should be a list of revocations. True: it is newer than the
  // one there was, and an authority has signed it; peers whose keys it names are lost.
  bool take_revocations(ByteView bytes);
  std::int64_t unix_time_ns(TimePoint now) const { return sessions_ ? sessions_->unix_ns(now) : 0; }
  void raise_unix_time_ns(TimePoint now, std::int64_t unix_time_ns) {
    if (sessions_) sessions_->raise_unix_ns(now, unix_time_ns);
  }
  // A key that two hosts use; ask until nothing comes.
  std::optional<PublicKey> poll_shared_key() {
    return sessions_ ? sessions_->poll_shared_key() : std::nullopt;
  }

  std::vector<PeerId> ids() const;
  std::vector<LinkState> links(TimePoint now, PeerId id) const;
  // All zero where there is no such peer.
  PeerLedger ledger(PeerId id) const;
  // Over all peers. Pieces sent again and found lost are counted of those that are still known.
  LinkCounters counters(LinkId link) const;
  std::uint64_t cancelled() const;
  std::size_t reassembly_bytes() const { return reassembly_.used(); }
  // How many bytes more messages to this peer may hold that find() gave; what messages hold.
  std::size_t send_room(PeerId id);
  std::size_t sending_bytes();

 private:
  struct Link {
    LinkInfo info;
    bool present = false;
    LinkCounters counters;
  };
  // A peer's place in entries_, by which Directory, Alarms and Turns know it.
  using Key = std::uint32_t;
  struct Entry {
    Entry(Key k, const Peer::Identity& identity, TimePoint now)
        : key(k), added_at(now), peer(identity, now) {}
    Key key = 0;
    TimePoint added_at{};
    // Of an unannounced peer: where its first packet came from.
    Address first_seen_at{};
    // Something has happened since the peer's alarm was set.
    bool touched = false;
    // How many paths of the try under way an initiation has left over.
    std::size_t initiations = 0;
    // What reassembly_ and sending_ know that the peer holds.
    std::size_t reassembly_bytes = 0;
    std::size_t sending_bytes = 0;
    Peer peer;
  };
  struct Found {
    Entry* entry = nullptr;
    bool restarted = false;
  };
  // The other half of receive(), where packets are encrypted and where they are not.
  Received receive_clear(TimePoint now, const Datagram& datagram);
  Received receive_sealed(TimePoint now, const Datagram& datagram);
  static void count_strange(const Datagram& datagram, LinkCounters& counters, Received& out);
  static void count_received(const wire::Packet& packet, const Datagram& datagram, bool is_served,
                             LinkCounters& counters, const Received& out);
  // False where the packet of a handshake is refused.
  bool take_handshake(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram,
                      Received& out);
  Found whose_sealed(TimePoint now, const crypto::Sessions::Opened& by, const wire::Packet& packet,
                     const Datagram& datagram);
  // Seals what is to leave; nothing where it must not leave.
  std::optional<TransmitParts> leave(TimePoint now, const Entry& entry, const TransmitParts& parts,
                                     std::span<std::byte> buffer);
  // Seals what answers a packet of this session and has no number of its own. False: it must not
  // leave.
  bool seal_answer(TimePoint now, SessionId session, std::span<std::byte> packet);
  std::optional<TransmitParts> poll_answers(TimePoint now, std::span<std::byte> buffer);
  std::optional<TransmitParts> poll_handshake(TimePoint now, std::span<std::byte> buffer);
  std::optional<TransmitParts> poll_initiation(TimePoint now, Entry& entry,
                                               std::span<std::byte> buffer);
  // Hands the list of revocations on to a peer that does not know it yet.
  void tell_revocations(TimePoint now, Entry& entry);
  // Whether no path to this peer is as it should be.
  static bool is_out_of_reach(const Peer& peer);
  void hand_over(TimePoint now, Entry& entry, const wire::Packet& packet, const Datagram& datagram,
                 Received& out);
  // Whose packet this is; nobody's where it is to be refused.
  Found whose(TimePoint now, const wire::Packet& packet, const Datagram& datagram);
  Entry* by_session(const wire::PacketHeader& header);
  Entry* by_address(const wire::PacketHeader& header, const Datagram& datagram);
  // Whether this packet proves the address that it comes from.
  bool is_token(TimePoint now, const wire::Packet& packet, const Datagram& datagram) const;
  // Whether the packet comes from where the peer is known to be, or to where it has moved, which it
  // has to prove first.
  bool is_there(TimePoint now, Entry& entry, const wire::Packet& packet, const Datagram& datagram);
  // A peer that we have connected to asks us to prove our address. False where it is refused.
  bool take_challenge(const wire::Packet& packet, const Datagram& datagram);
  // Answers an echo, if peers may come unannounced. False where it is refused.
  bool reflect(TimePoint now, const wire::Packet& packet, const Datagram& datagram);
  Entry& add(TimePoint now, SessionId session, bool connected);
  Entry* accept(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram);
  bool make_room(TimePoint now, const Address& from);
  void forget(Entry& entry);
  // Adds the addresses of a peer that we connect to, or takes them away while its paths change.
  void list_addresses(const Entry& entry);
  void unlist_addresses(const Entry& entry);
  Path::Nic nic(LinkId link) const;
  TransmitParts count(const TransmitParts& transmit);

  // Something has happened to this peer: its alarm may be wrong, and it may have something to send.
  void touch(Entry& entry);
  void mark(Entry& entry);
  // What this peer holds may have changed.
  void account(Entry& entry);
  void set_alarms(TimePoint now);
  // When something is due at this peer.
  TimePoint due_at(TimePoint now, const Entry& entry) const;

  Options options_;
  std::map<LinkId, Link> links_;
  // A place of a peer that is gone is empty and listed in free_.
  std::vector<std::unique_ptr<Entry>> entries_;
  std::vector<Key> free_;
  std::unordered_map<PeerId, Key> by_id_;
  Directory directory_;
  // How many peers came unannounced.
  std::size_t unannounced_ = 0;
  SharedMemory reassembly_;
  SharedMemory sending_;
  Alarms alarms_;
  Turns turns_;
  // The peers that are marked as touched, each once; and those of which something is due, while
  // handle_timeout() runs.
  std::vector<Key> touched_;
  std::vector<Key> due_;
  EchoReflector reflector_;
  AddressValidation validation_;
  // Where packets are encrypted.
  std::optional<crypto::Sessions> sessions_;
  std::deque<Lost> lost_;
  std::uint32_t next_ = 1;
};

}  // namespace interneuron
