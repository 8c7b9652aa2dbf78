// How long a packet would have had to wait in a queue, over all instants and not over packets: each
// instant weighs alike, so that a queue that stands counts even while nobody sends.
//
// The wait at an instant is the time until all that is in the queue by then has left it. It falls
// as time passes and rises when a packet enters. The queue tells of each packet that has left it.
// Resolution 0.1 ms. Memory: 8 bytes for each 0.1 ms of the longest wait. Pure; thread-compatible;
// no errors; times are since the start of the link.
#pragma once

#include <cstdint>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::emu {

class QueueTime {
 public:
  // Instants before `since` do not count.
  explicit QueueTime(Duration since = {}) : since_(since) {}

  // At each instant of [from, to) the wait was the time that was left until `gone`, which is not
  // before `to`.
  void add(Duration from, Duration to, Duration gone);
  // The queue was empty from `from` to `to`.
  void add_empty(Duration from, Duration to);

  // The wait that was not exceeded for this share of the time, 0 ≤ share ≤ 1; 0 while no time has
  // been counted. Rounded up to the resolution, but 0 where there was no queue.
  Duration quantile(double share) const;
  Duration mean() const;
  // The time that has been counted.
  Duration counted() const { return counted_; }

 private:
  Duration since_;
  Duration counted_{};
  Duration empty_{};
  // The time for which the wait was within the n-th step of the resolution.
  std::vector<std::int64_t> at_;
  // The sum of wait x time, in ns².
  double area_ = 0;
};

}  // namespace interneuron::emu
