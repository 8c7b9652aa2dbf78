// The sessions of an endpoint: which keys a packet was sealed with, whose they are, and when new
// ones are to be agreed on.
//
// The Gate of the peers (src/core/peers) owns one where packets are encrypted, and peers are known
// here by their places (Owner). For a peer that we connect to a handshake begins at once, again
// before its keys are old, while it cannot be heard, and where it was never heard with the keys of
// the last one: it may have begun a new life, or not have got these keys. A peer that comes
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
#include "core/secure/peer_keys.h"
#include "core/secure/responder.h"
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
  // A peer of which nothing was heard for so long, while no path is as it should be, may have begun
  // a new life. Asking it costs less than one heartbeat of each path. No measurement behind this
  // value: it has to be above the round trips and stalls of networks.
  static constexpr Duration kSilence = std::chrono::milliseconds(200);
  // A peer is told of a list of revocations again after so long at the earliest.
  static constexpr Duration kBetweenLists = std::chrono::seconds(10);

  // `accept`: initiations are answered. `ciphers`: what handshakes say that this host can. `shard`:
  // what numbers of sessions end with here; the door has none, and hands initiations on.
  Sessions(const Security& security, SessionId self, bool accept, TimePoint now,
           Ciphers ciphers = ciphers_here(), const Shard& shard = {});
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
  std::optional<PublicKey> poll_shared_key() { return shared_keys_.poll(); }
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

  // The time of day that credentials are judged by and handshakes say.
  TimeOfDay& time_of_day() { return time_of_day_; }
  const TimeOfDay& time_of_day() const { return time_of_day_; }

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
    // The shard that the packet is for; 0: it is handed on to none.
    std::uint8_t shard = 0;
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
  PeerKeys* held(Owner owner);
  const PeerKeys* held(Owner owner) const;
  LiveSession* live(std::uint32_t index);
  const LiveSession* live(std::uint32_t index) const;
  std::uint32_t draw_index();
  Initiator::Fresh fresh(TimePoint now);
  void drop(std::uint32_t& index);
  void promote(PeerKeys& held, std::uint32_t index);
  std::optional<TimePoint> lost_at(const PeerKeys& held) const;
  void ask_if_lost(TimePoint now, PeerKeys& held);
  void expire(TimePoint now, PeerKeys& held);
  void take_initiation(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram,
                       Shaken& out);
  void take_response(TimePoint now, Owner owner, ByteView packet, Shaken& out);
  void add_unowned(TimePoint now, std::uint32_t index);
  void drop_unowned(std::uint32_t& index);
  void forget_unowned(std::uint32_t index);
  void expire_unowned(TimePoint now);

  Bytes credential_;
  KeyPair own_;
  SessionId self_;
  bool accept_;
  Ciphers ciphers_;
  Shard shard_;
  TimeOfDay time_of_day_;
  Entropy entropy_;
  Trust trust_;
  Responder responder_;
  std::unordered_map<std::uint32_t, LiveSession> live_;
  // Initiations under way by their numbers.
  std::unordered_map<std::uint32_t, Owner> asking_;
  std::vector<std::unique_ptr<PeerKeys>> held_;
  std::map<PublicKey, Owner> adopted_;
  // The sessions of each key that belong to nobody: the newest, and the one before it until the
  // newest is used. All in the order of their birth.
  struct Unowned {
    std::uint32_t newest = 0;
    std::uint32_t former = 0;
  };
  std::map<PublicKey, Unowned> unowned_;
  std::deque<std::uint32_t> unowned_order_;
  SharedKeys shared_keys_;
};

}  // namespace interneuron::crypto
