// A Session-Reflector of RFC 8762 §4.3, unauthenticated mode, for `interneuron road --stamp`: one
// answer of the same size for each test packet that the caller hands to it, so that any STAMP
// sender can measure a path to this host.
//
// Stateful unless asked otherwise: the answers of a session are numbered from 0, and a session is
// whoever asks from one address at one NIC. An attacker with many forged addresses can push out the
// sessions of others, whose numbers then begin anew; he gains no amplification, and memory stays
// within kMaxSessions records. A reply looks like a request, so one packet forged in the name of
// another reflector makes the two answer each other: serve STAMP only in a network of your own.
// Pure; thread-compatible; never throws.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/wire/stamp.h"
#include "interneuron/endpoint.h"

namespace interneuron::probe {

class StampReflector {
 public:
  // Sessions that are numbered at once; a further one replaces the session that was silent for
  // longest. No measurement behind this value: it only has to be larger than the number of senders
  // that measure at the same time. 1,024 records take about 50 KB.
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
  // Writes the answer into `out` and returns its size in bytes; 0: the request is no test packet,
  // or the answer does not fit. `sent` is the instant at which the answer will leave. `wall` is
  // added to both instants and turns this host's monotonic clock into the time since 1900 that the
  // wire carries.
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
