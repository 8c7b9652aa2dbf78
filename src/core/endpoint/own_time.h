// The endpoint's own time: it never goes back, whatever the host's does (docs/paper.md, "Clock
// steps"). Pure; thread-compatible.
#pragma once

#include "interneuron/time.h"

namespace interneuron {

class OwnTime {
 public:
  explicit OwnTime(TimePoint host) : newest_(host) {}

  // The host's time is `host` now; the own time at that.
  TimePoint tick(TimePoint host) {
    if (host < newest_) shift_ += newest_ - host;
    newest_ = host;
    return own(host);
  }
  TimePoint now() const { return own(newest_); }
  TimePoint own(TimePoint host) const { return host + shift_; }
  TimePoint host(TimePoint own) const { return own - shift_; }

 private:
  TimePoint newest_;  // of the host
  Duration shift_{};
};

}  // namespace interneuron
