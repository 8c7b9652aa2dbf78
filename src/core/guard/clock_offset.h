// The clock offset to one peer, α = own clock - peer clock, from exchanges that ride in feedback
// (docs/paper.md, "Clock offset").
//
// Each exchange bounds α: lo <= α <= hi, hi - lo = RTT. The estimate is the middle of the exchange
// with the smallest round trip of the last 10 s; its error is at most RTT_min / 2. A constant added
// to either clock adds itself to α̂, hi and lo and to nothing else: everything here is differences,
// in integers that wrap. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/ring.h"
#include "interneuron/time.h"

namespace interneuron::guard {

// What a stage observer needs of the clocks between the origin and itself.
struct ClockView {
  std::int64_t alpha = 0;  // α̂, ns
  Duration rtt_min{};      // of the last hop; half of it bounds the error
};

class ClockOffset {
 public:
  // The smallest round trip is looked for in this window: a lifetime minimum would pile up drift.
  static constexpr Duration kWindow = std::chrono::seconds(10);
  // Clocks that move apart faster than this have stepped (docs/paper.md, "Clock steps").
  static constexpr std::int64_t kMaxDriftPpm = 500;

  enum class Update : std::uint8_t {
    kAccepted,
    kRejected,  // impossible (negative or absurd round trip): stale or hostile, ignored
    kStepped,   // a clock stepped: everything learnt before this exchange is dropped
  };

  // An exchange received at `r` (own clock): the peer sent it at `u` (its clock); it had received
  // our send instant `s` (own clock) `h` earlier.
  Update add(TimePoint r, PeerTime u, TimePoint s, Duration h);

  // Nothing while no exchange of the last kWindow is there.
  std::optional<ClockView> view(TimePoint now);
  // The smallest hi of the last kWindow: own clock - peer clock is never more.
  std::optional<Duration> hi_min(TimePoint now);

  void reset() { exchanges_.clear(); }

 private:
  struct Exchange {
    TimePoint at;
    std::int64_t hi;
    std::int64_t lo;
    std::int64_t rtt;
  };
  void prune(TimePoint now);
  bool contradicts(const Exchange& fresh) const;

  Ring<Exchange> exchanges_;  // oldest first
};

}  // namespace interneuron::guard
