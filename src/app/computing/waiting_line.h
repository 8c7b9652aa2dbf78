// The jobs of one peer that wait for the worker: which is due first, which has waited longest.
//
// Bounded by its owner, RoadsideUnit, which takes one out before it adds one too many; every call
// is linear in what waits, which is two jobs outside of experiments. `Job` is moved, never looked
// at. Thread-compatible; pure.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>

#include "interneuron/time.h"

namespace interneuron::computing {

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
