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

#include <deque>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/rate_limit.h"
#include "core/flow/reassembler.h"
#include "core/flow/receipts.h"
#include "core/flow/sender.h"
#include "core/flow/window_receiver.h"
#include "core/guard/clock_offset.h"
#include "core/peers/feedback_due.h"
#include "core/peers/path.h"
#include "core/peers/settlements.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"

namespace interneuron {

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
  // Whether this path leads over this NIC to this address.
  bool is_at(LinkId path, LinkId nic, const Address& address) const;
  // A packet of this path came in from there, and the peer has proved that it is there. The path is
  // new, or it follows its peer, since translators of carriers change the port that a peer is seen
  // at; but only for a packet that is newer than all before: one that was recorded and sent again
  // moves nothing.
  void follow(TimePoint now, const wire::PacketHeader& header, const Path::Nic& nic,
              const Address& address);
  // Whether the other address that a packet of this path comes from may be challenged now: only for
  // a packet that is newer than all before.
  bool may_challenge(TimePoint now, const wire::PacketHeader& header);
  // The peer wants to see this token before it believes the address that this path leaves from.
  // False: the path does not lead to where the challenge came from.
  bool challenged(LinkId path, LinkId nic, const Address& address, const wire::Token& token);
  // Measures the rate of a path now. False: there is no such path.
  bool request_train(TimePoint now, LinkId path);
  // Forgets the paths over this NIC; what they owed goes over the others.
  void remove_nic(TimePoint now, LinkId nic);
  bool has_path(LinkId path) const { return find(path) != nullptr; }
  std::span<const Path> paths() const { return paths_; }
  // No path is left.
  bool gone() const { return paths_.empty(); }

  // The peer has begun a new session: nothing that was learnt in the old one holds.
  void restart(TimePoint now, SessionId session);

  struct Input {
    // The packet had come before, or is too old to tell; it was dropped.
    bool duplicate = false;
    // The peer sends more packets than it may; this one was dropped.
    bool limited = false;
    // The peer has heard us for the first time: the round trip works.
    bool became_ready = false;
    bool clock_stepped = false;
    // A piece of a message was dropped for want of memory.
    bool refused = false;
    // A piece was dropped that contradicts others of its message.
    bool bad_piece = false;
    // The message that this packet completed, and what it begins with.
    std::optional<wire::MessageBytes> message;
    MessageId message_id{};
    wire::MessageKind kind{};
  };
  // What only time changes is looked at again, if that is some time ago. Call it before anything
  // that rests on the state of the paths.
  void look(TimePoint now);
  // `datagram`: what the packet was parsed from. `room`: how many bytes a message that begins with
  // it may take.
  Input handle(TimePoint now, const wire::Packet& packet, const Datagram& datagram,
               std::size_t room);
  // A piece that never came, computed from window symbols by what handle() took in; ask until
  // nothing comes. Whether there may be one.
  std::optional<Input> handle_computed(TimePoint now, std::size_t room);
  bool has_computed() const { return windows_.has_computed(); }
  // Returns how many incomplete messages were given up.
  std::size_t handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout(TimePoint now) const;
  // What the traffic of a path says of it has changed; ask until nothing comes.
  std::optional<PathChanged> poll_change();
  // Write the next packet that may leave now into `buffer` of at least kMaxDatagramBytes: feedback,
  // over whichever NIC is best; or a probe or data over this NIC.
  std::optional<TransmitParts> poll_feedback(TimePoint now, std::span<std::byte> buffer);
  std::optional<TransmitParts> poll(TimePoint now, LinkId nic, std::span<std::byte> buffer);

  // Queues a message on these paths; lost pieces go over these and over those of `repairs`. See
  // flow::Sender::send().
  MessageId send(TimePoint now, const flow::Sender::Times& times, wire::MessageBytes message,
                 std::span<const LinkId> paths, const flow::PathSet& repairs,
                 wire::MessageKind kind = wire::MessageKind::kRound,
                 const flow::Protection& protection = {});
  // See flow::Sender::add_alternative().
  MessageId add_alternative(TimePoint now, MessageId first, wire::MessageBytes message,
                            const flow::PathSet& rescue = {}) {
    return sender_.add_alternative(now, first, std::move(message), rescue);
  }
  // See flow::Sender::supersede().
  void supersede(MessageId better, MessageId worse) { sender_.supersede(better, worse); }
  // Nothing more of this message is sent.
  void cancel(MessageId message) { sender_.cancel(message); }
  // Whether so little of this message has left, over whichever path, that the peer cannot have it.
  bool is_surely_incomplete(MessageId message) const {
    return sender_.is_surely_incomplete(message);
  }
  // Bytes that this path has to send before a message of this deadline and importance.
  std::size_t queued_before(LinkId path, TimePoint deadline, std::uint8_t importance) const {
    return sender_.queued_before(path, deadline, importance);
  }

  // See flow::Sender::least_time().
  std::optional<Duration> least_time(LinkId path, std::size_t ip_bytes) const {
    return sender_.least_time(path, ip_bytes);
  }

  // What the peer and the own sender say of messages that were sent to it. Told only once a plain
  // message was sent; ask until nothing comes after handle() and from time to time.
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
  void mark_dropped(MessageId message) { receipts_.mark_dropped(message); }

  // A limit has struck this peer; kept in its ledger.
  void strike(TimePoint now, PeerLimit limit);
  // A limit that the application is to be told of: the first that struck in a second.
  std::optional<PeerLimit> take_limited() { return std::exchange(limited_, std::nullopt); }
  // What the peer holds here, as far as it is known here, and what has struck it.
  PeerLedger ledger() const;

  // A better variant was withheld that a path with this rate could have carried.
  void want(TimePoint now, DataRate rate);

  // The state of each path, with scores relative to the others.
  Links links(TimePoint now) const;
  std::optional<guard::ClockView> clock(TimePoint now) { return clock_.view(now); }
  const Identity& identity() const { return identity_; }
  bool ready() const { return ready_; }
  // The application may have been told of the peer: it was ready once, has sent a whole message or
  // was limited.
  bool known() const { return known_; }
  TimePoint heard_at() const { return heard_at_; }
  std::size_t reassembly_bytes() const { return reassembler_.bytes() + windows_.bytes(); }
  std::size_t sending_bytes() const { return sender_.bytes(); }
  std::uint64_t cancelled() const { return sender_.cancelled(); }
  // How many pieces were sent again, how many repair symbols were sent and how many packets were
  // found lost on paths over this NIC.
  struct Repairs {
    std::uint64_t resent = 0;
    std::uint64_t symbols = 0;
    std::uint64_t lost = 0;
  };
  Repairs repairs(LinkId nic) const;

 private:
  Path* find(LinkId path);
  const Path* find(LinkId path) const;
  void handle_feedback(TimePoint now, Path& path, const wire::Feedback& feedback, Input& input);
  // Puts a piece into its message. False where it is not wanted.
  bool take_piece(TimePoint now, const wire::Data& data, std::size_t room, Input& input);
  // Whether a piece is of a message that is larger than messages of its kind may be.
  bool is_too_large(const wire::Data& data) const;
  // Nothing of the message that this is a piece of is wanted.
  void refuse(TimePoint now, const wire::FragmentHeader& fragment, PeerLimit why, Input& input);
  void learn_report(TimePoint now, const wire::LinkReport& report);
  // An instant that is not after the one at which the peer sent a feedback that came in now with
  // this report of the path that it came over; nothing where its clock may have stepped meanwhile.
  std::optional<TimePoint> left_at(TimePoint now, const wire::LinkReport& report, Duration rtt_min);
  void refresh(TimePoint now);
  void collect_changes(TimePoint now, Path& path);
  void drop_dead_path(TimePoint now);
  bool take_changes(Path& path);
  void relieve(TimePoint now, const Path& path);
  // Messages that the reassembler has forgotten incomplete are to be told of.
  void tell_forgotten(TimePoint now);
  bool look_again(TimePoint now, std::vector<LinkId>& changed);
  std::uint64_t first_number(TimePoint now) const;
  void note_activity(TimePoint now);
  // Stamps count from the beginning of a session: rounded to microseconds they would otherwise
  // depend on where a clock stands.
  TimePoint session_time(TimePoint now) const { return TimePoint{now - identity_.started}; }
  const Path* reporter(const Path* first = nullptr) const;
  wire::PacketHeader header(TimePoint now, const Path& path, wire::PacketType type,
                            std::uint64_t number) const;
  TransmitParts send_feedback(TimePoint now, Path& path, std::span<const Path> about,
                              std::span<std::byte> buffer);
  std::optional<TransmitParts> poll_token(TimePoint now, std::span<std::byte> buffer);
  std::optional<TransmitParts> poll_copy(TimePoint now, std::span<std::byte> buffer);
  TransmitParts send_probe(TimePoint now, Path& path, std::span<std::byte> buffer);
  TransmitParts send_mtu_probe(TimePoint now, Path& path, std::size_t size,
                               std::span<std::byte> buffer);
  std::optional<TransmitParts> poll_data(TimePoint now, Path& path, std::span<std::byte> buffer);

  Identity identity_;
  std::vector<Path> paths_;
  flow::Sender sender_;
  // What the sender is given by send(); a member so that a message allocates nothing.
  std::vector<LinkId> over_;
  flow::Reassembler reassembler_;
  flow::WindowReceiver windows_;
  flow::Receipts receipts_;
  guard::ClockOffset clock_;
  // Since when it is known without a step.
  TimePoint clock_since_ = TimePoint::min();
  bool ready_ = false;
  bool known_ = false;
  TimePoint heard_at_;
  FeedbackDue feedback_;
  // The path that tells next what another one has just told.
  std::optional<LinkId> copy_over_;
  TimePoint refreshed_at_;
  std::deque<PathChanged> changes_;
  Settlements settlements_;
  RateLimit packets_;
  RateLimit messages_;
  PeerLedger ledger_;
  std::optional<PeerLimit> limited_;
  // When the next limit is told of.
  TimePoint tell_limit_at_ = TimePoint::min();
};

}  // namespace interneuron
