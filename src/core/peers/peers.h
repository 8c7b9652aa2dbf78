// The peers of an endpoint and the links they are reached over: whose a packet is, who may come
// unannounced, who began a new life, who has been silent for too long. Pure; thread-compatible;
// bounded.
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
    SessionId self{};
    bool accept = false;  // peers may come unannounced
    std::size_t max_unannounced = 0;
    bool repair = true;
    TimePoint started{};  // of the endpoint
  };
  explicit Peers(const Options& options) : options_(options), reflector_(options.self) {}

  void add_link(LinkId link, const LinkInfo& info);
  std::vector<PathChanged> remove_link(TimePoint now, LinkId link);
  // Throws std::invalid_argument when a link was not added.
  PeerId connect(TimePoint now, std::span<const std::pair<LinkId, Address>> addresses);
  // False: we have not connected to such a peer, or the link was not added.
  bool add_path(TimePoint now, PeerId peer, LinkId link, const Address& address);
  bool request_train(TimePoint now, PeerId peer, LinkId link);

  // Whose packet this is; adds, rebinds or restarts peers as the packet demands.
  struct Found {
    Peer* peer = nullptr;    // nobody we serve
    bool restarted = false;  // a known peer began a new life with this packet
  };
  Found whose(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram);

  // Answers an echo, if peers may come unannounced. False: it is refused.
  bool reflect(TimePoint now, const wire::Packet& packet, const Datagram& datagram);

  Peer* find(std::optional<PeerId> id);
  Peer* only() { return peers_.size() == 1 ? &peers_.begin()->second : nullptr; }

  struct Expired {
    std::size_t messages = 0;  // given up
    std::vector<PeerId> lost;
    std::vector<PathChanged> changes;
  };
  Expired handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout(TimePoint now) const;
  std::optional<Transmit> poll(TimePoint now, std::span<std::byte> buffer);

  std::vector<PeerId> ids() const;
  std::vector<LinkState> links(TimePoint now, PeerId id) const;
  LinkCounters& counters(LinkId link) { return links_[link].counters; }
  LinkCounters totals(LinkId link) const;  // with what the peers count
  std::uint64_t cancelled() const;
  std::size_t reassembly_bytes() const;

 private:
  struct Link {
    LinkInfo info;
    bool present = false;
    LinkCounters counters;
  };
  PeerId add(TimePoint now, SessionId session, bool connected);
  Peer* accept(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram);
  Path::Nic nic(LinkId link) const;
  Transmit count(const Transmit& transmit);
  void retire(SessionId session);

  Options options_;
  std::map<LinkId, Link> links_;
  std::map<PeerId, Peer> peers_;
  EchoReflector reflector_;
  std::deque<SessionId> retired_;
  std::uint32_t next_ = 1;
};

}  // namespace interneuron
