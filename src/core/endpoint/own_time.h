// The endpoint's own time. It never goes back: where the host's time does, the difference is added
// from then on (docs/paper.md, "Clock steps"). Everything inside an endpoint is in its own time,
// and only next_timeout() is told in the host's. Pure; thread-compatible.
#pragma once

#include "interneuron/time.h"

namespace interneuron {

class OwnTime {
 public:
  explicit OwnTime(TimePoint host) : newest_(host) {}

  // The host's time is `host` now. Returns the own time of this instant.
  TimePoint tick(TimePoint host) {
    if (host < newest_) shift_ += newest_ - host;
    newest_ = host;
    return own(host);
  }
  // The own time of the last tick().
  TimePoint now() const { return own(newest_); }
  // From one to the other, as the difference is now.
  TimePoint own(TimePoint host) const { return host + shift_; }
  TimePoint host(TimePoint own) const { return own - shift_; }

 private:
  // The host's time at the last tick().
  TimePoint newest_;
  // The own time less the host's.
  Duration shift_{};
};

}  // namespace interneuron
