// How long a silent UDP mapping on the way to a reflector (a carrier's NAT, a firewall) stays open.
// Each flow, a socket of its own, opens one by two echoes that are answered, asks for a reply after
// a silence (docs/wire_format.md, "Echo (type 4)", delay), and is silent until that should have
// come. Two flows per silence, because a packet may be lost.
//
// Drive it like a Measurement. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::probe {

using Silence = std::chrono::seconds;

inline constexpr Silence kShortestSilence{5};
inline constexpr Silence kLongestSilence{240};

struct SilenceResult {
  bool answered = false;            // the peer, to anything
  std::optional<Silence> survived;  // the longest
  std::optional<Silence> closed;    // the shortest that is longer than `survived` and ended it
  bool refused = false;             // a reply came early: the peer has no room for later ones
};

class SilenceTest {
 public:
  static constexpr std::size_t kFlowsPerSilence = 2;
  static constexpr std::size_t kFlowsAtMost = 8 * kFlowsPerSilence;

  // Silences up to `limit`, kShortestSilence … kLongestSilence; that is one of them. `session`: not
  // 0. `start`: not negative, as it goes on the wire.
  SilenceTest(Silence limit, SessionId session, TimePoint start);

  std::size_t flows() const { return flows_.size(); }

  struct Sending {
    std::size_t flow = 0;
    std::size_t size = 0;
  };
  // Writes the next packet that is due; nothing: none is.
  std::optional<Sending> poll(TimePoint now, std::span<std::byte> buffer);
  // `datagram` came to the socket of `flow`; `received`: when the kernel had it.
  void handle(TimePoint received, std::size_t flow, ByteView datagram);
  // Nothing when it is over.
  std::optional<TimePoint> next_timeout() const;
  bool done() const { return !next_timeout(); }
  // At the latest, from what is known; the past when it is over.
  TimePoint ends_at() const;

  // What is known; before it is over that may be less.
  SilenceResult result() const;

 private:
  enum class Phase : std::uint8_t {
    kOpening,
    kSilent,
    kUnanswered,  // could not be opened
    kSurvived,
    kClosed,
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
    std::vector<Request> requests;  // by sequence number
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
