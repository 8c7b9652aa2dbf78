// One peer of an endpoint: its paths, what is believed of them, its clock, what is under way in
// both directions. Joins the machines of flow, link and guard for one peer and keeps no logic of
// theirs. Pure; thread-compatible.
#pragma once

#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "core/flow/receiver.h"
#include "core/flow/sender.h"
#include "core/guard/clock_offset.h"
#include "core/peers/path.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"

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
  void add_path(TimePoint now, LinkId path, const Path::Nic& nic, const Address& address);
  bool request_train(TimePoint now, LinkId path);
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
  std::optional<TimePoint> next_timeout(TimePoint now) const;
  std::optional<PathChanged> poll_change();
  std::optional<Transmit> poll(TimePoint now, std::span<std::byte> buffer);

  void send(TimePoint now, TimePoint deadline, Duration lifetime, Bytes message,
            const std::vector<LinkId>& paths, const flow::PathSet& repairs);

  Links links(TimePoint now) const;
  std::optional<guard::ClockView> clock(TimePoint now) { return clock_.view(now); }
  const Identity& identity() const { return identity_; }
  bool ready() const { return ready_; }
  TimePoint heard_at() const { return heard_at_; }
  std::size_t reassembly_bytes() const { return reassembler_.bytes(); }
  std::uint64_t cancelled() const { return sender_.cancelled(); }
  // Pieces sent again and packets found lost on paths over this NIC.
  std::pair<std::uint64_t, std::uint64_t> repairs(LinkId nic) const;

 private:
  Path* find(LinkId path);
  const Path* find(LinkId path) const;
  void handle_feedback(TimePoint now, Path& path, const wire::Feedback& feedback, Input& input);
  void learn_report(TimePoint now, const wire::LinkReport& report);
  void refresh(TimePoint now);
  void collect_changes(TimePoint now, Path& path);
  bool take_changes(Path& path);
  bool look_again(TimePoint now, std::vector<LinkId>& unusable);
  std::uint64_t first_number(TimePoint now) const;
  void note_arrival(TimePoint now, bool gap);
  void note_activity(TimePoint now);
  Path* fastest();
  wire::PacketHeader header(const Path& path, wire::PacketType type, std::uint64_t number) const;
  std::optional<Transmit> poll_feedback(TimePoint now, std::span<std::byte> buffer);
  Transmit send_feedback(TimePoint now, Path& path, std::span<const Path> about,
                         std::span<std::byte> buffer);
  Transmit send_probe(TimePoint now, Path& path, std::span<std::byte> buffer);
  std::optional<Transmit> poll_data(TimePoint now, Path& path, std::span<std::byte> buffer);

  Identity identity_;
  std::vector<Path> paths_;
  flow::Sender sender_;
  flow::Reassembler reassembler_;
  guard::ClockOffset clock_;
  bool ready_ = false;
  TimePoint heard_at_;
  std::uint32_t unreported_ = 0;
  std::optional<TimePoint> feedback_at_;
  TimePoint feedback_sent_at_;
  TimePoint refreshed_at_;
  std::deque<PathChanged> changes_;
};

}  // namespace interneuron
