// The peers of an endpoint and the links over which they are reached: whose a packet is, who may
// come unannounced, who has begun a new session, who was silent for too long, whose turn it is.
//
// No call looks at every peer but those of remove_link() and the getters: PeerTable finds the peer
// of a packet, Alarms those with something due, Turns those with something to send. A peer's
// deadline is kept, and asked again only after something has happened to that peer. So a packet
// costs the same with a thousand peers as with one, but for the caches that they share.
//
// Owned and fed by Endpoint. Anybody may send to its ports, so the datagrams are any bytes: those
// that are malformed or of nobody that is served are counted and dropped. Unannounced peers are
// accepted only where the options say so, at most max_unannounced of them, and only at addresses
// that are proved (AddressValidation): until then an address costs no memory and gets nothing but
// challenges. Where all places are taken, whoever holds the most of them without use makes room
// (PeerTable::makes_room()). A peer that we connected to begins a new session only with a packet
// that shows that it has heard us, and is heard only where it was connected to. In the clear
// sessions are not authenticated: who has overheard that of a vehicle can send in its name, and who
// forges the address of a peer that we connected to in that one's; but neither moves a path to
// where it does not receive nor joins from there. With Options::security the Gate opens a packet by
// the keys of a handshake before any of this, so that nobody sends in the name of anybody else.
// Pure; thread-compatible.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/alarms.h"
#include "core/base/shared_memory.h"
#include "core/peers/gate.h"
#include "core/peers/peer_table.h"
#include "core/peers/turns.h"
#include "interneuron/endpoint.h"

namespace interneuron::peers {

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
    // What incomplete messages of all peers, and messages under way to them, may hold, in bytes.
    std::size_t reassembly_budget_bytes = 0;
    std::size_t send_budget_bytes = 0;
    // With what packets are encrypted; nothing: they are not.
    std::shared_ptr<const Security> security{};
    Shard shard{};
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
    // The datagram is for this shard.
    std::uint8_t shard = 0;
    Peer::Outcome outcome;
  };
  // Parses a datagram, finds whose it is (adds, moves or restarts peers as it demands, or queues a
  // challenge), hands it to that peer, and counts it. Any bytes may come.
  Received receive(TimePoint now, const Datagram& datagram);
  // What this peer's windows tell of other pieces after receive(); ask until nothing comes.
  std::optional<Peer::Outcome> receive_computed(TimePoint now, Peer& peer);

  // The peer, or the only one, with its state as of `now`; nullptr: there is no such peer. Whoever
  // asks may change the peer until the next poll() or handle_timeout().
  Peer* access(TimePoint now, std::optional<PeerId> id);
  Peer* access_only(TimePoint now);

  // How many incomplete messages were given up, and to whom others failed.
  struct Expired {
    std::size_t messages = 0;
    std::vector<PathChanged> changes;
    std::vector<PeerId> failed;
  };
  // Does what is due at or before `now`, peer by peer in the order of their deadlines.
  Expired handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout(TimePoint now) const;
  // Whether it was, when poll() last had nothing more to send.
  bool was_due(TimePoint now) const { return alarms_.due(now).has_value(); }
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
  Gate& gate() { return gate_; }
  std::vector<PeerId> ids() const { return table_.ids(); }
  std::vector<LinkState> links(TimePoint now, PeerId id) const;
  // All zero where there is no such peer.
  PeerLedger ledger(PeerId id) const;
  // Over all peers. Pieces sent again and found lost are counted of those that are still known.
  LinkCounters counters(LinkId link) const;
  std::uint64_t cancelled() const;
  std::size_t reassembly_bytes() const { return reassembly_.used(); }
  // How many bytes more messages to this peer may hold that access() gave; what messages hold.
  std::size_t send_room(PeerId id);
  std::size_t sending_bytes();

 private:
  struct Link {
    LinkInfo info;
    bool present = false;
    LinkCounters counters;
  };
  using Entry = PeerEntry;
  struct Found {
    Entry* entry = nullptr;
    bool restarted = false;
  };
  // Hands a packet to whom it is for. False where it is refused.
  bool serve(TimePoint now, const Gate::Passed& passed, const wire::Packet& packet,
             const Datagram& datagram, Received& out);
  // What a packet of a handshake over this path has brought.
  void take_handshake(TimePoint now, const crypto::Sessions::Shaken& shaken, LinkId path,
                      const Datagram& datagram, Received& out);
  // Whose this packet is, by the keys that it was sealed with or by what it says in the clear;
  // nobody's where it is to be refused.
  Found whose(TimePoint now, const crypto::Sessions::Opened& by, const wire::Packet& packet,
              const Datagram& datagram);
  Found whose(TimePoint now, const wire::Packet& packet, const Datagram& datagram);
  // Whether the packet comes from where the peer is known to be, or to where it has moved, which it
  // has to prove first.
  bool is_there(TimePoint now, Entry& entry, const wire::Packet& packet, const Datagram& datagram);
  // A peer asks us to prove our address. False where it is refused.
  bool take_challenge(const Gate::Passed& passed, const wire::Packet& packet,
                      const Datagram& datagram);
  Entry* accept(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram);
  bool take_place();
  Entry& add(TimePoint now, SessionId session, bool connected);
  void forget(Entry& entry);
  Path::Nic nic(LinkId link) const;
  TransmitParts count(const TransmitParts& transmit);
  std::optional<TransmitParts> poll_initiation(TimePoint now, Entry& entry,
                                               std::span<std::byte> buffer);
  // Hands the list of revocations on to a peer that does not know it yet.
  void tell_revocations(TimePoint now, Entry& entry);

  // Something has happened to this peer: its alarm may be wrong, it may have something to send, and
  // what it holds may have changed.
  void touch(Entry& entry);
  void mark(Entry& entry);
  void account(Entry& entry);
  void set_alarms(TimePoint now);
  TimePoint due_at(TimePoint now, const Entry& entry) const;

  Options options_;
  std::map<LinkId, Link> links_;
  std::shared_ptr<SharedHoldings> holdings_;
  PeerTable table_;
  Gate gate_;
  SharedMemory reassembly_;
  SharedMemory sending_;
  Alarms alarms_;
  Turns turns_;
  // The peers that are touched, each once; those of which something is due in handle_timeout().
  std::vector<PeerTable::Slot> touched_;
  std::vector<PeerTable::Slot> due_;
  std::deque<Lost> lost_;
};

}  // namespace interneuron::peers
