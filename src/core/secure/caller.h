// One path to one host that encrypts, for who has no Endpoint: `interneuron probe` seals its echoes
// with it. Caller agrees on keys, renews them, and turns datagrams in the clear into sealed ones
// and back; what it carries does not know of that.
//
// Drive it like an Endpoint: handle() what came in, poll() until it gives nothing, wait until
// next_timeout(). Whoever it calls sees no peer come: no address is proved and no token sent, so
// the host that has the same key and is a peer there stays one. Any bytes may come in; what is not
// authentic is dropped. Bounded like a session. Pure; thread-compatible.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "core/secure/sessions.h"

namespace interneuron::crypto {

class Caller {
 public:
  // Begins to call the only host that `security` trusts. Throws std::invalid_argument where there
  // is not exactly one, or something else in it cannot be right. `life`: random, not 0.
  Caller(TimePoint now, const Security& security, SessionId life, LinkId path);

  // Whether what is sent now can leave sealed.
  bool is_open(TimePoint now) const { return sessions_.is_open(now, kOwner); }
  // Writes the packet of a handshake that is due, and returns its size; 0: none is.
  std::size_t poll(TimePoint now, std::span<std::byte> buffer);
  // A datagram came in. What was sealed in it, as it would be in the clear; nothing of any other.
  // The view holds until the next call.
  std::optional<ByteView> handle(TimePoint now, ByteView datagram);
  // Seals a packet that was written in the clear. False: it must not leave.
  bool seal(TimePoint now, std::span<std::byte> packet);
  std::optional<TimePoint> next_timeout() const { return sessions_.next_timeout(kOwner); }

 private:
  static constexpr Sessions::Owner kOwner = 0;

  Sessions sessions_;
  SessionId life_;
  LinkId path_{};
  std::array<std::byte, kMaxDatagramBytes> opened_{};
};

}  // namespace interneuron::crypto
