// How a path was used since congestion control was last told: whether something had to wait, and
// for how long something was queued.
#pragma once

#include <cstdint>
#include <utility>

#include "interneuron/units.h"

namespace interneuron::flow {

// Owned and fed by the Sender, one per path. Pure; thread-compatible; constant memory.
class PathUse {
 public:
  // What congestion control is told (cc::ShareControl::Report).
  struct Told {
    // Something had to wait for the pace or the window.
    bool held_back = false;
    // For how long something was queued.
    Duration backlog{};
    // Packets found lost by silence.
    std::uint32_t lost = 0;
    // The rate at which the newest message is sent within kOwnPart of its time.
    DataRate needed{};
  };

  // A message of so many bytes is queued, which is to arrive within `left`.
  void message(TimePoint now, std::size_t bytes, Duration left) {
    told_.needed = rate_of(kOwnPart * bytes, left);
    queued(now);
  }
  // Something is queued.
  void queued(TimePoint now) {
    if (!queued_) since_ = now;
    queued_ = true;
  }
  // Nothing is queued any more.
  void emptied(TimePoint now) {
    if (queued_) told_.backlog += now - since_;
    queued_ = false;
  }
  // So many packets are lost that no report has told of.
  void lost(std::uint32_t packets) { told_.lost += packets; }
  // Something is queued that may not leave yet.
  void held_back() { told_.held_back = true; }

  DataRate needed() const { return told_.needed; }
  Told take(TimePoint now) {
    if (queued_) {
      told_.backlog += now - since_;
      since_ = now;
    }
    return std::exchange(told_, Told{.needed = told_.needed});
  }

 private:
  // The part of a message's time that may pass until it has left: a third of it, and the rest is
  // for the way and for queues. No measurement behind this value.
  static constexpr std::size_t kOwnPart = 3;

  Told told_;
  bool queued_ = false;
  TimePoint since_{};
};

}  // namespace interneuron::flow
