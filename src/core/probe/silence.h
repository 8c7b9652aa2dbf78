// Measures how long a silent UDP mapping on the way to a reflector (a carrier's address
// translation, a firewall) stays open, for `interneuron doctor`.
//
// Each flow has a socket of its own, and so a mapping of its own. It opens the mapping with two
// echoes that are answered, asks for a reply after a silence (`delay`, docs/wire_format.md, "Echo
// (type 4)"), and sends nothing until that reply should have come. Each silence is tried
// with two flows, because a packet may be lost.
//
// Drive it like a Measurement: handle() what came in, poll() until it gives nothing, wait until
// next_timeout(). Pure; thread-compatible; never throws. At most kFlowsAtMost flows of a few
// packets each. A reply counts only if it repeats the exact send instant of a request of its flow;
// whoever can see the packets can still make a mapping seem open.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/wire/packet.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::probe {

using Silence = std::chrono::seconds;

inline constexpr Silence kShortestSilence{5};
inline constexpr Silence kLongestSilence{240};

struct SilenceResult {
  // The peer answered anything at all.
  bool answered = false;
  // The longest silence that a mapping survived.
  std::optional<Silence> survived;
  // The shortest silence longer than `survived` after which no reply came.
  std::optional<Silence> closed;
  // A reply came early, because the peer had no room to keep it for later.
  bool refused = false;
};

class SilenceTest {
 public:
  static constexpr std::size_t kFlowsPerSilence = 2;
  static constexpr std::size_t kFlowsAtMost = 8 * kFlowsPerSilence;

  // Tries silences up to and with `limit`, which is within kShortestSilence … kLongestSilence.
  // `session` must not be 0; `start` must not be negative, because it goes on the wire.
  SilenceTest(Silence limit, SessionId session, TimePoint start);

  std::size_t flows() const { return flows_.size(); }

  struct Sending {
    std::size_t flow = 0;
    std::size_t size = 0;
  };
  // Writes the next packet that is due; nothing when none is.
  std::optional<Sending> poll(TimePoint now, std::span<std::byte> buffer);
  // `datagram` came to the socket of `flow`; the kernel had it at `received`.
  void handle(TimePoint received, std::size_t flow, ByteView datagram);
  // Nothing when it is over.
  std::optional<TimePoint> next_timeout() const;
  bool done() const { return !next_timeout(); }
  // When the test ends at the latest, as far as is known now; TimePoint::min() when it is over.
  TimePoint ends_at() const;

  // What is known so far; complete once done().
  SilenceResult result() const;

 private:
  enum class Phase : std::uint8_t {
    // Sends echoes until enough are answered.
    kOpening,
    // Has asked for a late reply and waits for it.
    kSilent,
    // Nobody answered the opening echoes.
    kUnanswered,
    // The reply came after the silence.
    kSurvived,
    // The reply did not come.
    kClosed,
    // The reply came before the silence was over.
    kRefused,
  };
  struct Request {
    TimePoint at;
    bool answered = false;
  };
  struct Flow {
    Silence silence{};
    TimePoint next_at;
    Phase phase = Phase::kOpening;
    // What the newest reply asks the next request to bring, so that its reply is delayed.
    wire::Token token{};
    // Indexed by sequence number.
    std::vector<Request> requests;
  };
  static bool is_over(const Flow& flow) {
    return flow.phase != Phase::kOpening && flow.phase != Phase::kSilent;
  }
  bool advance(TimePoint now, Flow& flow) const;
  bool any(Silence silence, Phase phase) const;

  SessionId session_;
  std::vector<Flow> flows_;
};

}  // namespace interneuron::probe
