// How much arrives at once over a link that is granted in bursts: all that waited, so that what
// left meanwhile is no queue of ours. BBR allows for it in the same way
// (draft-cardwell-iccrg-bbr-congestion-control-02, section 4.6.2.3, "extra_acked"), but takes the
// most of late; here it is the mean, because radios stall now and then and grants come regularly.
#pragma once

#include <cstddef>
#include <optional>

#include "interneuron/units.h"

namespace interneuron::cc {

// Owned and fed by the ShareControl of a path. What arrived is the peer's word. Constant memory.
// Pure; thread-compatible; never throws.
class Aggregation {
 public:
  // So many bytes with IP headers are newly known to have arrived, over a pipe of this rate.
  void arrived(TimePoint now, std::size_t bytes, DataRate capacity);
  // What arrives at once, as the time that it takes at the rate.
  Duration mean() const { return mean_; }

 private:
  // Since when at least as much has arrived as at the rate, how much that was, and how far ahead of
  // the rate it was at most.
  std::optional<TimePoint> since_;
  double bytes_ = 0;
  Duration most_{};
  Duration mean_{};
};

}  // namespace interneuron::cc
