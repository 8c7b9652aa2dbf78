// The jobs of a RoadsideUnit: how it treats them, what it tells of them, and the line in which
// those of one peer wait. Pure.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>

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

// The jobs of one peer that wait for the worker: which is due first, which has waited longest.
//
// Bounded by its owner, RoadsideUnit, which takes one out before it adds one too many; every call
// is linear in what waits, which is two jobs outside of experiments. `Job` is moved, never looked
// at. Thread-compatible.
template <class Job>
class WaitingLine {
 public:
  struct Entry {
    Job job;
    // Names the job within the unit; a later one has a larger number.
    std::uint64_t id = 0;
    // When its round is over at the latest.
    TimePoint due{};
    // The last instant at which its computation may begin.
    TimePoint chance{};
  };

  void add(Entry entry) { entries_.push_back(std::move(entry)); }
  std::size_t size() const { return entries_.size(); }
  bool empty() const { return entries_.empty(); }
  const std::deque<Entry>& entries() const { return entries_; }

  // The two ask for a line that is not empty. Of several that are due at once the oldest is first.
  const Entry& first_due() const {
    assert(!empty());
    return *std::ranges::min_element(entries_, {}, &Entry::due);
  }
  const Entry& oldest() const {
    assert(!empty());
    return entries_.front();
  }
  // Takes out the job of this number, which must be there.
  Entry take(std::uint64_t id) {
    const auto found = std::ranges::find(entries_, id, &Entry::id);
    assert(found != entries_.end());
    Entry entry = std::move(*found);
    entries_.erase(found);
    return entry;
  }

 private:
  // The oldest first.
  std::deque<Entry> entries_;
};

}  // namespace interneuron::computing
