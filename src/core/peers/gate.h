// What stands between the peers of an endpoint and the networks that lead to them: what comes in is
// opened before anything else looks at it, what leaves is sealed after everything else was done,
// and strangers are answered here, with challenges, replies to echoes and the packets of
// handshakes, so that none of them becomes a peer before it has shown where it is.
//
// With Options::security packets are encrypted; without it they pass as they are, and whoever asks
// need not know: nobody has keys then, no handshake is due, and no list of revocations is known.
// Owned and fed by Peers, which names its peers here by their places (Slot). Anybody may send any
// bytes: what is not authentic changes nothing but the memory, bounded, of AddressValidation,
// EchoReflector and crypto::Responder. Pure; thread-compatible; throws std::invalid_argument where
// its options or a key to connect to cannot be right.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "core/peers/address_validation.h"
#include "core/probe/reflectors.h"
#include "core/secure/sessions.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"

namespace interneuron::peers {

class Gate {
 public:
  using Slot = crypto::Sessions::Owner;
  struct Options {
    // Our session.
    SessionId self{};
    // Handshakes and echoes are answered.
    bool accept = false;
    // When this endpoint began its session.
    TimePoint started{};
    // Drawn at random and told to nobody.
    Secret secret{};
    // With what packets are encrypted; nothing: they are not.
    std::shared_ptr<const Security> security{};
    // Which of several endpoints this one is.
    Shard shard{};
  };
  explicit Gate(const Options& options);

  bool encrypts() const { return sessions_.has_value(); }
  // The link is gone: no stranger is answered over it any more.
  void remove_link(LinkId link);

  // --- what comes in
  enum class Verdict : std::uint8_t {
    // It goes on to the peers.
    kPacket,
    // It was of a handshake, and was used.
    kHandshake,
    // It is of a handshake with the shard that `shaken` names.
    kElsewhere,
    kMalformed,
    // It came over a link that is not there.
    kRefused,
    // It is of nobody who has keys, or was changed on its way.
    kForged,
    kReplayed,
  };
  struct Passed {
    Verdict verdict = Verdict::kMalformed;
    // The packet as it was before it was sealed, without its tag; valid until the next call.
    ByteView packet{};
    // Whose keys it was sealed with; nothing: it is in the clear.
    std::optional<crypto::Sessions::Opened> by{};
    // What a packet of a handshake has brought, and for which path, whatever the verdict is.
    std::optional<crypto::Sessions::Shaken> shaken{};
    LinkId path{};
  };
  // `is_there`: whether the link of the datagram is.
  Passed receive(TimePoint now, const Datagram& datagram, bool is_there);

  // --- strangers
  // Whether this packet proves the address that it comes from.
  bool is_token(TimePoint now, const wire::Packet& packet, const Datagram& datagram) const;
  // Queues a challenge for whoever sent this packet.
  void challenge(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram) {
    validation_.challenge(now, header, datagram);
  }
  // Queues the answer to an echo. False where it is refused.
  bool reflect(TimePoint now, const wire::Packet& packet, const Datagram& datagram);
  // Writes the next answer to a stranger into `buffer` of at least kMaxDatagramBytes.
  std::optional<TransmitParts> poll_answer(TimePoint now, std::span<std::byte> buffer);
  // When one is due although nothing comes in.
  std::optional<TimePoint> next_answer() const { return reflector_.next_timeout(); }

  // --- what leaves to peers
  // Seals a packet of this peer's that lies in `buffer`, but for its payload, which is encrypted
  // into its place there. Nothing: it must not leave.
  std::optional<TransmitParts> seal_for(TimePoint now, Slot slot, const TransmitParts& parts,
                                        std::span<std::byte> buffer);
  // Whether an initiation to this peer is to leave now over each of its paths; writes that of one
  // path; it has left over all of them.
  bool initiation_due(TimePoint now, Slot slot) {
    return sessions_ && sessions_->initiation_due(now, slot);
  }
  std::size_t write_initiation(Slot slot, LinkId path, std::span<std::byte> buffer) const {
    return sessions_->write_initiation(slot, path, buffer);
  }
  void initiation_sent(TimePoint now, Slot slot) { sessions_->initiation_sent(now, slot); }

  // --- the keys of peers
  // Whom connect() is to reach: who was named, or else the only peer that is trusted.
  std::optional<PublicKey> whom(const std::optional<PublicKey>& named) const;
  // `who`: what whom() has said.
  void connect(TimePoint now, Slot slot, const std::optional<PublicKey>& who) {
    if (sessions_) sessions_->connect(now, slot, *who);
  }
  // The peer that has this key already, of those that came unannounced.
  std::optional<Slot> owner_of(const PublicKey& who) const { return sessions_->owner_of(who); }
  // The session of this number, which belongs to nobody yet, is this peer's.
  void adopt(Slot slot, SessionId session) { sessions_->adopt(slot, session.value); }
  void path_added(TimePoint now, Slot slot) {
    if (sessions_) sessions_->path_added(now, slot);
  }
  // The peer is gone, and its keys with it.
  void remove(Slot slot) {
    if (sessions_) sessions_->remove(slot);
  }
  std::optional<TimePoint> next_timeout(Slot slot) const {
    return sessions_ ? sessions_->next_timeout(slot) : std::nullopt;
  }
  // `is_out_of_reach`: no path to this peer is as it should be.
  void handle_timeout(TimePoint now, Slot slot, bool is_out_of_reach);

  // --- revocations
  // The newest list that is known, signed; empty: there is none.
  ByteView revocations() const {
    return sessions_ ? ByteView(sessions_->trust().revocations()) : ByteView{};
  }
  // Takes a signed list of revocations that is newer than the one there is. False: it is none.
  bool take_revocations(ByteView bytes) { return sessions_ && sessions_->take_revocations(bytes); }
  bool is_revoked(Slot slot) const { return sessions_->is_revoked(slot); }
  // Whether this peer knows an older list than we do; from now on it is taken to know ours.
  bool take_turn_to_tell(TimePoint now, Slot slot) {
    return sessions_->take_turn_to_tell(now, slot);
  }

  // --- for the application
  // See Endpoint::unix_time_ns(); 0 where packets are not encrypted.
  std::int64_t unix_ns(TimePoint now) const {
    return sessions_ ? sessions_->time_of_day().unix_ns(now) : 0;
  }
  void raise_unix_ns(TimePoint now, std::int64_t unix_ns) {
    if (sessions_) sessions_->time_of_day().raise_unix_ns(now, unix_ns);
  }
  // A key that two hosts use; ask until nothing comes.
  std::optional<PublicKey> poll_shared_key() {
    return sessions_ ? sessions_->poll_shared_key() : std::nullopt;
  }

 private:
  Passed open(TimePoint now, const Datagram& datagram, bool is_there);
  bool seal_answer(TimePoint now, SessionId session, std::span<std::byte> packet);
  std::optional<TransmitParts> poll_handshake(TimePoint now, std::span<std::byte> buffer);

  bool accept_ = false;
  probe::EchoReflector reflector_;
  AddressValidation validation_;
  // Where packets are encrypted.
  std::optional<crypto::Sessions> sessions_;
  // What was opened last.
  std::array<std::byte, kMaxDatagramBytes> opened_;
};

}  // namespace interneuron::peers
