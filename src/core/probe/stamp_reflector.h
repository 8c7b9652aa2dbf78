// A Session-Reflector of RFC 8762 §4.3, unauthenticated mode, for `interneuron road --stamp`: one
// answer of the same size for each test packet that the caller hands to it, so that any STAMP
// sender can measure a path to this host.
//
// Stateful unless asked otherwise: the answers of a session are numbered from 0, and a session is
// whoever asks from one address at one NIC. An attacker with many forged addresses can push out the
// sessions of others, whose numbers then begin anew; he gains no amplification, and memory stays
// within kMaxSessions records. He can have this host send to an address that he forges, as many
// packets as he sends himself and no more than SourceLimit lets each source have.
//
// Two reflectors must never answer each other, because a packet forged in the name of one would
// keep both busy for ever, and a reply has the form of a request. So nothing is answered that comes
// from the port of a reflector (862, or our own) or that has all marks of a reply, whether of STAMP
// or of EchoReflector. Senders that pad their requests with zeros or random bytes are answered: the
// marks are 40 bits that padding would have to hit.
// Pure; thread-compatible; never throws.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/probe/answer_limit.h"
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

  // `port` is the one that requests come to.
  explicit StampReflector(bool stateful, std::uint16_t port = wire::kStampPort)
      : stateful_(stateful), port_(port) {}

  struct Request {
    LinkId nic{};
    Address from{};
    ByteView bytes;
    std::uint8_t ttl = 0;
    TimePoint received{};
  };
  // Writes the answer into `out` and returns its size in bytes; 0: the request is no test packet,
  // its sender may be a reflector or has had all answers that it may have, or the answer does not
  // fit. `sent` is the instant at which the answer will leave. `wall` is
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
  bool from_reflector(const Request& request) const;
  Session& session_of(const Request& request);

  bool stateful_;
  std::uint16_t port_;
  SourceLimit limit_{kAnswerInterval, kAnswerBurst};
  std::vector<Session> sessions_;
};

}  // namespace interneuron::probe
