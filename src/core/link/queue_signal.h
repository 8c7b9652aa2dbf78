// How long packets wait in queues one way: their one-way delay above the smallest of the last 10 s.
// The delay may contain any offset between the two clocks, which cancels; a drift of 100 ppm adds
// 1 ms in 10 s.
#pragma once

#include "core/link/windowed_minimum.h"
#include "interneuron/time.h"

namespace interneuron::link {

// One direction of one path; owned and fed by its LinkEstimator. Pure; thread-compatible; constant
// memory.
class QueueSignal {
 public:
  // Queues fill and drain within this, so that older samples say nothing of now. No measurement
  // behind this value: it only has to be larger than the interval of idle heartbeats, 300 ms.
  static constexpr Duration kFresh = std::chrono::seconds(2);

  // Own or peer's receive instant minus the other's send instant; any int64, wrapping. With the
  // clock exchange of docs/paper.md, "Clock offset": up = (u - h) - s, down = r - u.
  void add(TimePoint now, Duration one_way);
  // Smoothed with gain 1/4; zero while unknown or when the newest sample is older than kFresh.
  Duration queue(TimePoint now) const;
  // The same as far as it can be there still: what waited when the newest sample came has left
  // since then, or there would be newer ones.
  Duration left(TimePoint now) const;
  // A clock stepped: old and new delays cannot be compared.
  void reset() { *this = {}; }

 private:
  WindowedMinimum minimum_;
  bool any_ = false;
  TimePoint at_{};
  Duration smoothed_{};
};

}  // namespace interneuron::link
