// The sessions of an endpoint: which keys a packet was sealed with, whose they are, and when new
// ones are to be agreed on.
//
// Peers (src/core/peers) owns one where packets are encrypted, and knows its peers here by their
// places (Owner). For a peer that we connect to a handshake begins at once, again before its keys
// are old, while it cannot be heard, and where it was never heard with the keys of the last one: it
// may have begun a new life, or not have got these keys. A peer that comes
// unannounced begins as a session without owner: it has proved who it is, and has to show where it
// is before it becomes a peer (adopt()).
//
// A new session takes the place of the one before only when a packet sealed with it has come in: of
// two that connect at the same moment or of a handshake that somebody has recorded, none destroys
// what works. The session before it still opens packets until it is kRejectAfter old, when it is
// erased. What an outsider sends changes nothing here. Bounded by the peers there are, four
// sessions each, and by kMaxUnowned. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "core/secure/entropy.h"
#include "core/secure/handshake.h"
#include "core/secure/responder.h"
#include "core/secure/session.h"
#include "core/secure/trust.h"
#include "interneuron/endpoint.h"
#include "interneuron/security.h"

namespace interneuron::crypto {

class Sessions {
 public:
  // A peer's place in Peers.
  using Owner = std::uint32_t;
  // Sessions of hosts that have not shown where they are; the oldest makes room.
  static constexpr std::size_t kMaxUnowned = 1024;
  // A session is renewed up to so much later than kRekeyAfter, so that not all vehicles that joined
  // together ask together again.
  static constexpr Duration kRekeyJitter = std::chrono::seconds(10);
  // Renewals for want of paths are at least this far apart.
  static constexpr Duration kBetweenRekeys = std::chrono::seconds(1);
  // A peer of which nothing was heard for so long, while no path is as it should be, may have begun
  // a new life. Asking it costs less than one heartbeat of each path. No measurement behind this
  // value: it has to be above the round trips and stalls of networks.
  static constexpr Duration kSilence = std::chrono::milliseconds(200);
  // A handshake for want of packets begins no sooner after one that was answered: the other side
  // has to get our first packet and answer it, and may be about to. Twice as long after each that
  // led to nothing, up to Initiator::kLastRetry. No measurement behind this value: it has to be
  // above the round trips of networks and what heartbeats are apart.
  static constexpr Duration kFirstPatience = std::chrono::seconds(1);
  // A peer is told of a list of revocations again after so long at the earliest.
  static constexpr Duration kBetweenLists = std::chrono::seconds(10);
  // The latest time that is believed, which is in the year 2097: who says a later one cannot keep a
  // host that believed it from being heard before kLatestUnixNs.
  static constexpr std::int64_t kLatestBelievedNs = kLatestUnixNs - (std::int64_t{1} << 59U);
  // Lives of one key that are remembered, and keys of which they are.
  static constexpr std::size_t kMaxLives = 8;
  static constexpr std::size_t kMaxKeysWithLives = 1024;
  static constexpr Duration kBetweenSharedKeys = std::chrono::minutes(1);

  // `accept`: initiations are answered.
  Sessions(const Security& security, SessionId self, bool accept, TimePoint now);
  // What belongs to it refers to its trust.
  Sessions(const Sessions&) = delete;
  Sessions& operator=(const Sessions&) = delete;

  // --- peers
  const Trust& trust() const { return trust_; }
  // Takes a signed list of revocations that is newer than the one there is. False: it is none.
  bool take_revocations(ByteView bytes) { return trust_.take_revocations(bytes); }
  // Whether this peer knows an older list than we do; from now on it is taken to know ours.
  bool take_turn_to_tell(TimePoint now, Owner owner);
  // Whether this peer's key is revoked.
  bool is_revoked(Owner owner) const;
  // A key that two hosts use; ask until nothing comes.
  std::optional<PublicKey> poll_shared_key();
  // Wants a session with this host, whose key is trusted, from now on.
  void connect(TimePoint now, Owner owner, const PublicKey& who);
  // Whether connect() was told this key, and remove() was not told its peer.
  bool is_connected(const PublicKey& who) const;
  // The session with this number, which belongs to nobody yet, is this peer's.
  void adopt(Owner owner, std::uint32_t index);
  // The peer is gone, and its sessions with it.
  void remove(Owner owner);
  // The peer that this key was adopted for.
  std::optional<Owner> owner_of(const PublicKey& who) const;
  // Whether packets to this peer can leave.
  bool is_open(TimePoint now, Owner owner) const;
  // Whether no path to a peer that we connect to is as it should be.
  void set_out_of_reach(TimePoint now, Owner owner, bool is_out_of_reach);
  // There is another path to it: what is asked for is asked for there at once.
  void path_added(TimePoint now, Owner owner);

  // The time of day, ns since 1970, as far as is known: what was said at the beginning or by a host
  // that we connected to, and never less than what was said here. Keep it for the next start.
  std::int64_t unix_ns(TimePoint now) const;
  // The host's clock says so. Counts where it is later.
  void raise_unix_ns(TimePoint now, std::int64_t unix_ns);

  // --- what comes in
  struct Opened {
    Session::Opened result = Session::Opened::kForged;
    // The host that has sealed it, and its life.
    std::optional<Owner> owner;
    PublicKey who{};
    SessionId life{};
  };
  // Opens a sealed packet into `out`, which holds kMaxDatagramBytes.
  Opened open(TimePoint now, const wire::PacketHeader& header, ByteView packet,
              std::span<std::byte> out);

  struct Shaken {
    bool is_used = false;
    // A peer that we connect to has answered: from now on packets to it can leave.
    std::optional<Owner> answered;
    // An initiation to `owner` may be due at once.
    bool may_be_due = false;
    // Its life.
    SessionId life{};
    // It wants to see this over the path of the packet.
    std::optional<wire::Token> token;
    Owner owner = 0;
  };
  // A packet of a handshake, from anybody.
  Shaken take_handshake(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram);

  // --- what leaves
  // Seals a packet to this peer, as Session::seal() does. False: it must not leave.
  bool seal(TimePoint now, Owner owner, std::span<std::byte> packet, ByteView payload = {});
  // The same with the session of this number, whoever has it.
  bool seal_with(TimePoint now, std::uint32_t index, std::span<std::byte> packet);
  // Whether an initiation to this peer is to leave now over each of its paths; makes its message.
  bool initiation_due(TimePoint now, Owner owner);
  std::size_t write_initiation(Owner owner, LinkId path, std::span<std::byte> out) const;
  // It has left over all paths.
  void initiation_sent(TimePoint now, Owner owner);
  Responder& responder() { return responder_; }

  // --- time, peer by peer
  std::optional<TimePoint> next_timeout(Owner owner) const;
  void handle_timeout(TimePoint now, Owner owner);

 private:
  struct Slot {
    Slot(const PublicKey& host, const Hello& hello, Session&& s)
        : who(host), life(hello.life), revocations_s(hello.revocations_s), session(std::move(s)) {}
    PublicKey who{};
    SessionId life{};
    // The list of revocations that the other side knows.
    std::int64_t revocations_s = 0;
    std::optional<Owner> owner;
    Session session;
  };
  // What a peer has: numbers of sessions, 0 for none.
  struct Held {
    PublicKey who{};
    std::uint32_t current = 0;
    // Opens what was sealed before; and what a new handshake has led to, until it is used.
    std::uint32_t former = 0;
    std::uint32_t next = 0;
    // What a handshake before that has led to: the other side may use it until it has our answer to
    // the newest.
    std::uint32_t earlier = 0;
    // The list of revocations that it was last told of, and when.
    std::int64_t told_s = 0;
    TimePoint told_at{};
    // Of a peer that we connect to.
    std::optional<Initiator> initiator;
    TimePoint rekey_at = TimePoint::max();
    // When a packet was last opened with the current session; nothing: none ever was.
    std::optional<TimePoint> heard_at;
    bool is_out_of_reach = false;
    // See kFirstPatience.
    TimePoint ask_after{};
    Duration patience = kFirstPatience;
  };
  Held* held(Owner owner);
  const Held* held(Owner owner) const;
  Slot* slot(std::uint32_t index);
  const Slot* slot(std::uint32_t index) const;
  std::uint32_t draw_index();
  Initiator::Fresh fresh(TimePoint now);
  std::int64_t next_unix_ns(TimePoint now);
  void drop(std::uint32_t& index);
  void promote(Held& held, std::uint32_t index);
  std::optional<TimePoint> lost_at(const Held& held) const;
  void ask_if_lost(TimePoint now, Held& held);
  void expire(TimePoint now, Held& held);
  void take_initiation(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram,
                       Shaken& out);
  void take_response(TimePoint now, Owner owner, ByteView packet, Shaken& out);
  void add_unowned(TimePoint now, std::uint32_t index);
  void drop_unowned(std::uint32_t& index);
  void forget_unowned(std::uint32_t index);
  void expire_unowned(TimePoint now);
  void note_life(TimePoint now, const PublicKey& who, SessionId life);

  // The lives that a key has had lately, newest last.
  struct Lives {
    std::vector<SessionId> known;
    TimePoint told_at = TimePoint::min();
  };

  Bytes credential_;
  std::int64_t unix_time_ns_;
  KeyPair own_;
  SessionId self_;
  bool accept_;
  TimePoint started_;
  std::int64_t said_ns_ = 0;
  Entropy entropy_;
  Trust trust_;
  Responder responder_;
  std::unordered_map<std::uint32_t, Slot> slots_;
  // Initiations under way by their numbers.
  std::unordered_map<std::uint32_t, Owner> asking_;
  std::vector<std::unique_ptr<Held>> held_;
  std::map<PublicKey, Owner> adopted_;
  // The sessions of each key that belong to nobody: the newest, and the one before it until the
  // newest is used. All in the order of their birth.
  struct Unowned {
    std::uint32_t newest = 0;
    std::uint32_t former = 0;
  };
  std::map<PublicKey, Unowned> unowned_;
  std::deque<std::uint32_t> unowned_order_;
  std::map<PublicKey, Lives> lives_;
  std::deque<PublicKey> shared_keys_;
};

}  // namespace interneuron::crypto
