// One host that encrypts, for who has no Endpoint: `interneuron probe` seals its echoes with it.
// Caller agrees on keys, renews them, and turns datagrams in the clear into sealed ones and back;
// what it carries does not know of that.
//
// Drive it like an Endpoint: handle() what came in; when is_due(), send what write() gives over
// each path and say sent(); wait until next_timeout(). Whoever it calls sees no peer come: no
// address is proved and no token sent. Any bytes may come in; what is not authentic is dropped.
// Bounded like a session. Pure; thread-compatible.
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
  Caller(TimePoint now, const Security& security, SessionId life);

  // Whether what is sent now can leave sealed.
  bool is_open(TimePoint now) const { return sessions_.is_open(now, kOwner); }
  // Whether a packet of a handshake is to leave over each path.
  bool is_due(TimePoint now);
  // Writes that of this path, where it is due; returns its size.
  std::size_t write(LinkId path, std::span<std::byte> out) const {
    return sessions_.write_initiation(kOwner, path, out);
  }
  void sent(TimePoint now) { sessions_.initiation_sent(now, kOwner); }
  // A datagram came in. What was sealed in it, as it would be in the clear; nothing of any other.
  // The view holds until the next call.
  std::optional<ByteView> handle(TimePoint now, ByteView datagram);
  // Seals a packet that was written in the clear. False: it must not leave.
  bool seal(TimePoint now, std::span<std::byte> packet) {
    return sessions_.seal(now, kOwner, packet);
  }
  // See TimeOfDay::unix_ns().
  std::int64_t unix_ns(TimePoint now) const { return sessions_.time_of_day().unix_ns(now); }
  std::optional<TimePoint> next_timeout() const { return sessions_.next_timeout(kOwner); }

 private:
  static constexpr Sessions::Owner kOwner = 0;

  Sessions sessions_;
  SessionId life_;
  std::array<std::byte, kMaxDatagramBytes> opened_{};
};

}  // namespace interneuron::crypto
