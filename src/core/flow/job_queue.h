// What one path still has to send: a job for each message, those of the lowest rank first and of
// these the one with the earliest deadline.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <vector>

#include "core/base/id_map.h"
#include "core/flow/job.h"
#include "interneuron/time.h"

namespace interneuron::flow {

// Sender owns one per path and adds a job for each message that it queues on the path; a job stays
// until remove(), also when nothing of it is left. Of equal ranks and deadlines the job that was
// added first is served first.
//
// The first job and the sum of all bytes are read in O(1), a job is found in O(1), added and
// removed in O(log n); bytes_before() looks at the jobs on one side of the turn, whichever are
// fewer. Memory grows with the largest number of jobs at a time and is used again; nothing is
// allocated while there are no more jobs than before. Jobs stay where they are until the next
// add(). Pure; thread-compatible.
class JobQueue {
 public:
  // When a job is served among the others.
  struct Turn {
    std::uint8_t rank = 0;
    TimePoint deadline{};
    friend auto operator<=>(const Turn&, const Turn&) = default;
  };

  bool empty() const { return order_.empty(); }
  std::size_t size() const { return order_.size(); }

  // nullptr where there is none.
  Job* first() { return empty() ? nullptr : &slots_[order_.begin()->slot].job; }
  const Job* first() const { return empty() ? nullptr : &slots_[order_.begin()->slot].job; }
  Job* find(MessageId message);
  const Job* find(MessageId message) const;
  // The messages that have jobs, in the order in which these were added.
  std::vector<MessageId> messages() const;

  // A job for a message that has none, of the fragments next … count - 1 of `chunk` bytes each.
  Job& add(MessageId message, const Turn& turn, std::uint32_t next, std::uint16_t count,
           std::uint16_t chunk);
  void remove(MessageId message);
  void clear();

  // This fragment is to be sent again, before those that were not sent yet.
  void push_again(Job& job, std::uint16_t index) {
    job.again.push_back(index);
    bytes_ += job.chunk;
  }
  // Takes the next fragment of a job; nothing when none is left.
  struct Taken {
    std::uint16_t index = 0;
    bool is_again = false;
  };
  std::optional<Taken> take(Job& job);
  // Takes the last of those that have not left yet, of which there is one.
  std::uint16_t take_last(Job& job) {
    bytes_ -= job.chunk;
    return --job.count;
  }
  // Takes all of them.
  std::vector<std::uint16_t> take_all(Job& job);

  // Bytes of all fragments, and of those of jobs whose turn is not after this one.
  std::size_t bytes() const { return bytes_; }
  std::size_t bytes_before(const Turn& turn) const;

 private:
  struct Place {
    Turn turn;
    // Counts the jobs that were added.
    std::uint64_t number = 0;
    std::uint32_t slot = 0;
    friend auto operator<=>(const Place&, const Place&) = default;
  };
  using Order = std::set<Place>;
  struct Slot {
    Job job;
    Order::iterator place;
  };

  std::vector<Slot> slots_;
  std::vector<std::uint32_t> free_;
  Order order_;
  // Nodes of jobs that have ended, for the next ones.
  std::vector<Order::node_type> spare_;
  IdMap<MessageId> by_message_;
  std::uint64_t added_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace interneuron::flow
