// One peer of an endpoint: its paths, its clock, and what is under way in both directions. Joins
// the machines of flow, link and guard for one peer: it hands them what comes in, asks them what is
// due, and writes the packets.
//
// Owned and fed by Peers: handle() with packets of this peer's session that came over one of its
// paths, handle_timeout() and poll() when next_timeout() is reached. What the peer says is not
// trusted: duplicates are dropped per path, incomplete messages are held in bounded memory, and
// reports can only be about packets that were sent. At most wire::kMaxReports paths. Pure;
// thread-compatible.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/flow/sender.h"
#include "core/guard/clock_offset.h"
#include "core/peers/intake.h"
#include "core/peers/paths.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"

namespace interneuron::peers {

class Peer {
 public:
  struct Identity {
    PeerId id{};
    // Our session.
    SessionId self{};
    // The peer's session; 0 until it is heard.
    SessionId session{};
    // We have asked for this peer: its addresses were given to us. Those of any other are proved.
    bool connected = false;
    // Lost pieces are sent again.
    bool repair = true;
    // When this endpoint began its session.
    TimePoint started{};
    PeerLimits limits = {};
    // Its packets are encrypted.
    bool encrypted = false;
  };
  Peer(const Identity& identity, TimePoint now);

  // Adds a path, or moves a known one there.
  void add_path(TimePoint now, LinkId path, const Path::Nic& nic, const Address& address);
  // A packet of this path came in from there, and the peer has proved that it is there. The path is
  // new, or it follows its peer, since translators of carriers change the port that a peer is seen
  // at; but only for a packet that is newer than all before: one that was recorded and sent again
  // moves nothing.
  void follow(TimePoint now, const wire::PacketHeader& header, const Path::Nic& nic,
              const Address& address);
  // Forgets the paths over this NIC; what they owed goes over the others.
  void remove_nic(TimePoint now, LinkId nic);
  Paths& paths() { return paths_; }
  const Paths& paths() const { return paths_; }

  // The peer has begun a new session: nothing that was learnt in the old one holds.
  void restart(TimePoint now, SessionId session);

  using Outcome = PacketOutcome;
  // What only time changes is looked at again, if that is some time ago. Call it before anything
  // that rests on the state of the paths.
  void look(TimePoint now);
  // `datagram`: what the packet was parsed from. `room`: how many bytes a message that begins with
  // it may take.
  Outcome handle(TimePoint now, const wire::Packet& packet, const Datagram& datagram,
                 std::size_t room);
  // A piece that never came, computed from window symbols by what handle() took in; ask until
  // nothing comes.
  std::optional<Outcome> handle_computed(TimePoint now, std::size_t room);
  // Returns how many incomplete messages were given up.
  std::size_t handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout(TimePoint now) const;
  // Write the next packet that may leave now into `buffer` of at least kMaxDatagramBytes: feedback,
  // over whichever NIC is best; or a probe or data over this NIC.
  std::optional<TransmitParts> poll_feedback(TimePoint now, std::span<std::byte> buffer);
  std::optional<TransmitParts> poll(TimePoint now, LinkId nic, std::span<std::byte> buffer);

  // Queues a message on these paths; lost pieces go over these and over those of `repairs`. See
  // flow::Sender::send().
  MessageId send(TimePoint now, const flow::Sender::Times& times, wire::MessageBytes message,
                 const flow::PathList& paths, const flow::PathSet& repairs,
                 wire::MessageKind kind = wire::MessageKind::kRound,
                 const flow::Protection& protection = {});
  // What is sent to the peer, beside send(), and how far it has got.
  flow::Sender& sender() { return sender_; }
  const flow::Sender& sender() const { return sender_; }
  // What the peer and the own sender say of messages that were sent to it. Told only once a plain
  // message was sent; ask until nothing comes, after handle() and handle_timeout().
  std::optional<Settled> poll_settled() {
    if (const auto settled = settlements_.poll()) return settled;
    if (const auto message = sender_.poll_given_up()) {
      return Settled{Settled::Kind::kGivenUp, *message};
    }
    if (const auto message = sender_.poll_incomplete()) {
      return Settled{Settled::Kind::kIncomplete, *message};
    }
    return std::nullopt;
  }
  // A message that handle() gave is dropped here: tells the peer.
  void mark_dropped(MessageId message) { intake_.receipts.mark_dropped(message); }
  // A limit has struck this peer; kept in its ledger.
  void strike(TimePoint now, PeerLimit limit) { intake_.strike(now, limit); }
  // What the peer has sent.
  Intake& intake() { return intake_; }
  const Intake& intake() const { return intake_; }

  // See Paths::want().
  void want(TimePoint now, DataRate rate) { paths_.want(now, rate); }
  // See Paths::states().
  Links links(TimePoint now) const { return paths_.states(now, identity_.encrypted); }
  std::optional<guard::ClockView> clock(TimePoint now) { return session_.clock.view(now); }
  const Identity& identity() const { return identity_; }
  bool ready() const { return session_.ready; }
  // The application may have been told of the peer: it was ready once, has sent a whole message or
  // was limited.
  bool known() const { return was_ready_ || intake_.is_known(); }
  TimePoint heard_at() const { return heard_at_; }
  // How many pieces were sent again, how many repair symbols were sent and how many packets were
  // found lost on paths over this NIC.
  struct Repairs {
    std::uint64_t resent = 0;
    std::uint64_t symbols = 0;
    std::uint64_t lost = 0;
  };
  Repairs repairs(LinkId nic) const;

 private:
  void handle_feedback(TimePoint now, Path& path, const wire::Feedback& feedback, Outcome& outcome);
  // Puts a piece into its message. False where it is not wanted.
  bool take_piece(TimePoint now, const wire::Data& data, std::size_t room, Outcome& outcome);
  void learn_report(TimePoint now, const wire::LinkReport& report);
  // An instant that is not after the one at which the peer sent a feedback that came in now with
  // this report of the path that it came over; nothing where its clock may have stepped meanwhile.
  std::optional<TimePoint> left_at(TimePoint now, const wire::LinkReport& report, Duration rtt_min);
  void refresh(TimePoint now);
  void collect_changes(TimePoint now, Path& path);
  void drop_dead_path(TimePoint now);
  void relieve(TimePoint now, const Path& path);
  bool look_again(TimePoint now, std::vector<LinkId>& changed);
  // Stamps count from the beginning of a session: rounded to microseconds they would otherwise
  // depend on where a clock stands.
  TimePoint session_time(TimePoint now) const { return TimePoint{now - identity_.started}; }
  wire::PacketHeader header(TimePoint now, const Path& path, wire::PacketType type,
                            std::uint64_t number) const;
  TransmitParts send_feedback(TimePoint now, Path& path, std::span<const Path> about,
                              std::span<std::byte> buffer);
  std::optional<TransmitParts> poll_copy(TimePoint now, std::span<std::byte> buffer);
  TransmitParts write_probe(TimePoint now, const Path& path, std::uint64_t number, std::size_t size,
                            std::span<std::byte> buffer) const;
  std::optional<TransmitParts> poll_data(TimePoint now, Path& path, std::span<std::byte> buffer);

  Identity identity_;
  Paths paths_;
  flow::Sender sender_;
  Intake intake_;
  // What holds only while the peer's session lasts.
  struct Session {
    guard::ClockOffset clock;
    // Since when it is known without a step.
    TimePoint clock_since = TimePoint::min();
    // The peer has echoed our session.
    bool ready = false;
    // The path that tells next what another one has just told.
    std::optional<LinkId> copy_over;
  };
  Session session_;
  // The peer has echoed our session in this one of its own or in one before.
  bool was_ready_ = false;
  TimePoint heard_at_;
  TimePoint refreshed_at_;
  Settlements settlements_;
};

}  // namespace interneuron::peers
