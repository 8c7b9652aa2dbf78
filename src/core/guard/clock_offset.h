// The clock offset to one peer, α = own clock - peer clock, from exchanges that ride in feedback
// (docs/paper.md, "Clock offset").
//
// Each exchange bounds α: lo <= α <= hi, and hi - lo is its round trip. The estimate is the middle
// of the exchange with the smallest round trip of the last kWindow; its error is at most half that
// round trip. A constant added to either clock adds itself to the estimate, to hi and to lo, and to
// nothing else: everything here is differences, in integers that wrap.
//
// The instants of an exchange are the peer's bytes and may be anything. Exchanges that are
// impossible are rejected. A peer that lies consistently moves its own estimate only, and one whose
// exchanges contradict each other is taken for one whose clock has stepped.
//
// An exchange is kept for kWindow, or until a newer one tells at least as much: that bounds α from
// no further away on both sides. Where round trips vary some tens are kept, of thousands; at most
// kMaxExchanges. Time grows with them. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::guard {

// The clocks between the origin of a round and this node.
struct ClockView {
  // The estimate of α, in ns: the sum over the hops in between.
  std::int64_t alpha = 0;
  // The smallest round trip of the last hop. Half of it bounds the error of that hop's estimate.
  Duration rtt_min{};
};

class ClockOffset {
 public:
  // The smallest round trip is looked for in this window: a lifetime minimum would pile up drift.
  static constexpr Duration kWindow = std::chrono::seconds(10);
  // Clocks that move apart faster than this have stepped (docs/paper.md, "Clock steps").
  static constexpr std::int64_t kMaxDriftPpm = 500;

  enum class Update : std::uint8_t {
    kAccepted,
    // The round trip would be negative or absurd: the exchange is stale or hostile, and ignored.
    kRejected,
    // A clock has stepped: all exchanges before this one are dropped.
    kStepped,
  };

  // An exchange that was received at `r` on our clock. The peer sent it at `u` on its clock; `s` is
  // the instant of ours that it answers, which the peer had received `h` before `u`.
  Update add(TimePoint r, PeerTime u, TimePoint s, Duration h);

  // Nothing while there is no exchange of the last kWindow.
  std::optional<ClockView> view(TimePoint now);
  // The smallest hi of the last kWindow, which α never exceeds.
  std::optional<Duration> hi_min(TimePoint now);

 private:
  struct Exchange {
    TimePoint at;
    std::int64_t hi;
    std::int64_t lo;
    std::int64_t rtt;
  };
  void prune(TimePoint now);
  bool contradicts(const Exchange& fresh) const;

  // Oldest first.
  std::vector<Exchange> exchanges_;
};

}  // namespace interneuron::guard
