// What a RoadsideUnit is told and tells of jobs. Plain values.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/computing/no_answer.h"
#include "interneuron/round.h"

namespace interneuron::computing {

// Deadlines that peers state are believed up to here: a round that may take longer is treated as if
// it ended then, so that nothing waits for hours. A hundred times the deadline of a camera's round;
// no measurement behind it.
inline constexpr Duration kLongestBelieved = std::chrono::seconds(10);

// How a RoadsideUnit treats its jobs.
struct UnitRules {
  // Jobs of one peer that wait, beside the one that runs. Two: the newest image and one that a
  // burst brought with it; a third would wait for two computations and more, longer than a round
  // at 10 Hz has.
  std::size_t waiting_per_peer = 2;
  // Whether of a peer's jobs the one that is due first is first, and one that cannot be answered in
  // time any more ends without being computed. Else they are computed in the order in which they
  // came, however late.
  bool minds_deadlines = true;
};

// One computation that has begun. Instants are of the unit's host.
struct Computed {
  RoundRef round;
  PeerId from{};
  std::uint8_t variant = 0;
  std::size_t level = 0;
  // The input was sent degraded.
  bool degraded = false;
  TimePoint delivered{};
  TimePoint began{};
  // Set when the computation has ended.
  TimePoint ended{};
};

// What a unit has done for a peer, and has to do.
struct PeerWork {
  // Jobs that wait for the worker.
  std::size_t waiting = 0;
  // Jobs by how they ended.
  std::uint64_t computed = 0;
  std::uint64_t crowded_out = 0;
  std::uint64_t too_late = 0;
  std::uint64_t unreadable = 0;
  // How long the worker was busy with them.
  Duration busy{};

  std::uint64_t unanswered() const { return crowded_out + too_late + unreadable; }
  void count(NoAnswer why) {
    if (why == NoAnswer::kCrowdedOut) ++crowded_out;
    if (why == NoAnswer::kTooLate) ++too_late;
    if (why == NoAnswer::kUnreadable) ++unreadable;
  }
};

}  // namespace interneuron::computing
