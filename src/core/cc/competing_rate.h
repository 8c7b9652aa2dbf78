// A rate beside senders that give way to no queue, only to losses: as CUBIC's (RFC 9438), in rates
// in place of windows.
//
// Whoever gives way to the queue of a CUBIC flow is left nothing, so Copa (Arun and Balakrishnan,
// Copa: Practical Delay-Based Congestion Control for the Internet, 2018) behaves as TCP does for as
// long as such a flow is there. Ours is CUBIC itself, so that equal demands get equal shares. What
// an application does not use, it has not earned: the rate is at most twice what it asks for
// (RFC 7661, section 4.3), so that one which asks for less than its share has enough after a fall
// or two. And while few packets are lost, it is what is asked for as long as that is less than half
// of what others have.
#pragma once

#include <cstdint>

#include "interneuron/units.h"

namespace interneuron::cc {

// Owned and fed by CrowdShare. What was lost is the peer's word: one that hides losses gets twice
// of what is asked for on its own path at most, one that invents them slows down what is sent to
// itself. Constant memory. Pure; thread-compatible; never throws.
class CompetingRate {
 public:
  void begin(TimePoint now, DataRate rate);
  // Packets were lost or marked; those of a round trip are one loss.
  void lost(TimePoint now, std::uint32_t packets, Duration round_trip);
  // What it has come to, of an application that asks for so much on a pipe of this capacity.
  DataRate at(TimePoint now, Duration round_trip, DataRate wanted, DataRate capacity);

 private:
  double lost_lately(TimePoint now) const;

  DataRate rate_{};
  // The rate that it comes back to, and from when on.
  DataRate before_{};
  TimePoint fell_at_{};
  // Packets that are lost per second, in the mean, and when they were counted.
  double lost_ = 0;
  TimePoint lost_at_{};
};

}  // namespace interneuron::cc
