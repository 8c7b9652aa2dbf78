// A Session-Reflector of RFC 8762 §4.3, unauthenticated mode: one answer of the same size for each
// test packet. Stateful unless asked otherwise: answers are numbered per session, which is whoever
// asks at one NIC. Pure; thread-compatible; memory is bounded.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/wire/stamp.h"
#include "interneuron/endpoint.h"

namespace interneuron::probe {

class StampReflector {
 public:
  // Beyond, the session that was silent for longest is forgotten; chosen.
  static constexpr std::size_t kMaxSessions = 1024;
  // A session that was silent for so long is over: the next packet begins a new one. REFWAIT of
  // RFC 5357 §3.1, which STAMP's ancestor has for it: 900 s.
  static constexpr Duration kSessionSilence = std::chrono::seconds(900);

  explicit StampReflector(bool stateful) : stateful_(stateful) {}

  struct Request {
    LinkId nic{};
    Address from{};
    ByteView bytes;
    std::uint8_t ttl = 0;
    TimePoint received{};
  };
  // Writes the answer and returns its size; 0: it is no test packet, or does not fit. `sent`: the
  // instant it will leave at. `wall`: what makes both the time on the wire.
  std::size_t answer(const Request& request, TimePoint sent, Duration wall,
                     std::span<std::byte> out);

 private:
  struct Session {
    LinkId nic{};
    Address from{};
    std::uint32_t answers = 0;
    TimePoint heard{};
  };
  Session& session_of(const Request& request);

  bool stateful_;
  std::vector<Session> sessions_;
};

}  // namespace interneuron::probe
