// The peers of an endpoint and the links over which they are reached: whose a packet is, who may
// come unannounced, who has begun a new session, who was silent for too long.
//
// Owned and fed by Endpoint. Anybody may send to its ports, so the datagrams are any bytes: those
// that are malformed or of nobody that is served are counted and dropped. Unannounced peers are
// accepted only where the options say so, and at most max_unannounced of them; an address that was
// not given to us gets at most three times what it sends (Path). Sessions are not authenticated:
// who knows the session of a peer can send in its name. Pure; thread-compatible.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/peers/peer.h"
#include "core/probe/echo_reflector.h"
#include "interneuron/endpoint.h"

namespace interneuron {

// An unannounced peer that was silent for this long is forgotten; its reference times are forgotten
// after the same time (docs/paper.md, "Clock steps").
inline constexpr Duration kPeerSilence = std::chrono::seconds(60);

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
  };
  explicit Peers(const Options& options) : options_(options), reflector_(options.self) {}

  void add_link(LinkId link, const LinkInfo& info);
  std::vector<PathChanged> remove_link(TimePoint now, LinkId link);
  // Begins to talk to a peer at these addresses, one per link. Throws std::invalid_argument when a
  // link was not added.
  PeerId connect(TimePoint now, std::span<const std::pair<LinkId, Address>> addresses);
  // False: we have not connected to such a peer, or the link was not added.
  bool add_path(TimePoint now, PeerId peer, LinkId link, const Address& address);
  // Measures the rate of a path now. False: there is no such path.
  bool request_train(TimePoint now, PeerId peer, LinkId link);

  struct Received {
    // nullptr where there is nothing more to do: the datagram was malformed, was refused, or was an
    // echo, which is answered by the next poll().
    Peer* peer = nullptr;
    // A known peer has begun a new session with this packet.
    bool restarted = false;
    Peer::Input input;
  };
  // Parses a datagram, finds whose it is (adds, rebinds or restarts peers as it demands), hands it
  // to that peer, and counts it. Any bytes may come.
  Received receive(TimePoint now, const Datagram& datagram);

  // nullptr: there is no such peer.
  Peer* find(std::optional<PeerId> id);
  // The only peer there is, else nullptr.
  Peer* only() { return peers_.size() == 1 ? &peers_.begin()->second : nullptr; }

  struct Expired {
    // How many incomplete messages were given up.
    std::size_t messages = 0;
    // Unannounced peers that were silent for kPeerSilence or have no path left: they are forgotten.
    std::vector<PeerId> lost;
    std::vector<PathChanged> changes;
  };
  Expired handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout(TimePoint now) const;
  // Writes the next datagram that may leave now into `buffer` of at least kMaxDatagramBytes.
  std::optional<Transmit> poll(TimePoint now, std::span<std::byte> buffer);

  std::vector<PeerId> ids() const;
  std::vector<LinkState> links(TimePoint now, PeerId id) const;
  // Over all peers. Pieces sent again and found lost are counted of those that are still known.
  LinkCounters counters(LinkId link) const;
  std::uint64_t cancelled() const;
  std::size_t reassembly_bytes() const;

 private:
  struct Link {
    LinkInfo info;
    bool present = false;
    LinkCounters counters;
  };
  struct Found {
    Peer* peer = nullptr;
    bool restarted = false;
  };
  // Whose packet this is; nobody's where it is to be refused.
  Found whose(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram);
  // Answers an echo, if peers may come unannounced. False where it is refused.
  bool reflect(TimePoint now, const wire::Packet& packet, const Datagram& datagram);
  PeerId add(TimePoint now, SessionId session, bool connected);
  Peer* accept(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram);
  Path::Nic nic(LinkId link) const;
  Transmit count(const Transmit& transmit);
  void retire(SessionId session);

  Options options_;
  std::map<LinkId, Link> links_;
  std::map<PeerId, Peer> peers_;
  EchoReflector reflector_;
  // Sessions that restarted peers had before, oldest first.
  std::deque<SessionId> retired_;
  std::uint32_t next_ = 1;
};

}  // namespace interneuron
