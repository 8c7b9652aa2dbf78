// One peer of an endpoint: its paths, what is believed of them, its clock, what is under way in
// both directions. Joins the machines of flow, link and guard for one peer and keeps no logic of
// theirs. Pure; thread-compatible.
//
// A path is named by the link id of the side that connected; this side may reach several paths over
// one NIC.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "flow/receiver.h"
#include "flow/sender.h"
#include "guard/clock_offset.h"
#include "interneuron/endpoint.h"
#include "link/link_estimator.h"
#include "wire/packet.h"

namespace interneuron {

class Peer {
 public:
  struct Identity {
    PeerId id{};
    SessionId self{};
    SessionId session{};     // the peer's; 0 until heard
    bool connected = false;  // we asked for it: its addresses are trusted
    bool repair = true;
    TimePoint started{};  // when the endpoint began its life
  };
  Peer(const Identity& identity, TimePoint now);

  // A path not known yet is added; a known one follows its peer to a new address (carrier NATs
  // rebind).
  void add_path(TimePoint now, LinkId path, LinkId nic, const Address& address,
                std::size_t max_datagram);
  void remove_nic(TimePoint now, LinkId nic);
  bool has_path(LinkId path) const { return find(path) != nullptr; }
  bool reached_at(LinkId nic, const Address& address) const;
  bool gone() const { return paths_.empty(); }

  // The peer began a new life: nothing learnt from its old one holds.
  void restart(TimePoint now, SessionId session);

  struct Input {
    bool duplicate = false;
    bool became_ready = false;  // it has heard us: the round trip works
    bool clock_stepped = false;
    bool refused = false;  // no memory for it
    std::optional<Bytes> message;
  };
  Input handle(TimePoint now, const wire::Packet& packet, std::size_t datagram_bytes);
  // Returns how many messages were given up.
  std::size_t handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout() const;
  std::optional<Transmit> poll(TimePoint now, std::span<std::byte> buffer);

  void send(TimePoint now, TimePoint deadline, Duration lifetime, Bytes message,
            const std::vector<LinkId>& paths);

  std::vector<LinkState> links(TimePoint now) const;
  std::optional<guard::ClockView> clock(TimePoint now) { return clock_.view(now); }
  const Identity& identity() const { return identity_; }
  bool ready() const { return ready_; }
  TimePoint heard_at() const { return heard_at_; }
  std::size_t reassembly_bytes() const { return reassembler_.bytes(); }
  std::uint64_t cancelled() const { return sender_.cancelled(); }
  // Pieces sent again and packets found lost on paths over this NIC.
  std::pair<std::uint64_t, std::uint64_t> repairs(LinkId nic) const;

 private:
  struct Path {
    LinkId id{};
    LinkId nic{};
    Address address{};
    std::size_t max_datagram = 0;
    flow::PathReceiver receiver{LinkId{}};
    link::LinkEstimator estimator;
    TimePoint heartbeat_at{};
    std::optional<TimePoint> train_at;  // when the last start-up train began
    std::uint32_t train_left = 0;
    std::uint64_t bytes_in = 0;
    std::uint64_t bytes_out = 0;
    bool validated = false;  // the peer has echoed our session on it
    std::uint64_t lost = 0;
  };
  Path* find(LinkId path);
  const Path* find(LinkId path) const;
  void handle_feedback(TimePoint now, Path& path, const wire::Feedback& feedback, Input& input);
  void learn_report(TimePoint now, const wire::LinkReport& report);
  void refresh_views(TimePoint now);
  std::uint64_t first_number(TimePoint now) const;
  void note_arrival(TimePoint now, bool gap);
  Duration heartbeat_interval(TimePoint now) const;
  Path* fastest(TimePoint now);
  bool may_send(const Path& path, std::size_t size) const;
  wire::PacketHeader header(const Path& path, wire::PacketType type, std::uint64_t number) const;
  Transmit out(Path& path, std::size_t size);
  std::optional<Transmit> poll_feedback(TimePoint now, std::span<std::byte> buffer);
  Transmit send_feedback(TimePoint now, Path& path, std::span<std::byte> buffer);
  std::optional<Transmit> poll_train(TimePoint now, Path& path, std::span<std::byte> buffer);

  Identity identity_;
  std::vector<Path> paths_;
  flow::Sender sender_;
  flow::Reassembler reassembler_;
  guard::ClockOffset clock_;
  bool ready_ = false;
  TimePoint heard_at_;
  TimePoint active_at_;  // last message sent or received
  std::uint32_t unreported_ = 0;
  std::optional<TimePoint> feedback_at_;
  TimePoint feedback_sent_at_;
};

}  // namespace interneuron
