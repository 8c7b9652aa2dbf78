// How long one job of a peer may take where several peers share one worker: its part of the time
// that passes between two jobs of its own. A vehicle that sends ten images a second beside one
// other gets 50 ms for each, one that sends a hundred 5 ms: whoever sends more often gets lighter
// levels, and all together never ask for more time than there is. FairTurns alone would give each
// its part too, but a job that has begun is not interrupted: the others would wait for one that
// takes as long as the sender likes.
//
// A peer counts while it has sent something within the last kActive. A peer alone may take any
// time, and so may one whose interval is not known yet. The interval is smoothed, since what
// arrives over a radio link comes in bursts. A part that somebody leaves unused is not given to
// others: whoever counts on it would have it taken away with the next image.
//
// Fed by RoadsideUnit. Bounds: one entry for each peer until forget(). What an attacker can do is
// to count as one peer, as an honest one does. Calls are O(log n), amortised. Thread-compatible;
// pure.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::computing {

class ShareOfTime {
 public:
  // Ten periods of a camera at 10 Hz: who skips a few images keeps its place. No measurement behind
  // it.
  static constexpr Duration kActive = std::chrono::seconds(1);
  // The weight of the newest interval, so that about the last eight count, as for round-trip times
  // (RFC 6298).
  static constexpr int kSmoothing = 8;

  // A job of the peer came, whether it is computed or not.
  void came(PeerId peer, TimePoint now);
  void forget(PeerId peer);

  // The longest that one job of the peer may take now.
  Duration longest(PeerId peer, TimePoint now);
  // The peers that count now.
  std::size_t active(TimePoint now);

 private:
  struct Arrivals {
    TimePoint last{};
    std::optional<Duration> interval;
  };

  std::map<PeerId, Arrivals> peers_;
  // Those that count, who was silent longest first.
  std::set<std::pair<TimePoint, PeerId>> active_;
};

}  // namespace interneuron::computing
