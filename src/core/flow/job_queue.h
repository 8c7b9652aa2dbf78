// What one path still has to send: a job for each message, those of the lowest rank first and of
// these the one with the earliest deadline.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <set>
#include <vector>

#include "core/base/id_tables.h"
#include "core/base/ring.h"
#include "core/base/spare_nodes.h"
#include "interneuron/message.h"
#include "interneuron/sizes.h"
#include "interneuron/time.h"

namespace interneuron::flow {

// The size of a packet that carries a piece of so many bytes, IP headers included.
constexpr std::size_t ip_bytes_of_piece(std::size_t piece_bytes) {
  return piece_bytes + kPieceOverheadBytes + kIpUdpBytes;
}

// Fragments that are to be sent again, in the order in which they were found lost. Whether one is
// among them is told in O(1). Part of a Job. Pure; thread-compatible.
class AgainList {
 public:
  bool empty() const { return order_.empty(); }
  std::size_t size() const { return order_.size(); }
  std::uint16_t front() const { return order_.front(); }
  std::uint16_t operator[](std::size_t i) const { return order_[i]; }
  bool contains(std::uint16_t index) const { return index < times_.size() && times_[index] > 0; }

  void push_back(std::uint16_t index) {
    if (index >= times_.size()) times_.resize(std::size_t{index} + 1);
    ++times_[index];
    order_.push_back(index);
  }
  void pop_front() {
    --times_[order_.front()];
    order_.pop_front();
  }
  // Keeps its memory for the next job, so that losses allocate nothing, unless it is large.
  void clear() {
    if (times_.size() > kMostKept) {
      *this = {};
    } else {
      while (!empty()) pop_front();
    }
  }

 private:
  // Fragments for which the memory is kept: those of a message of 1.4 MB. No measurement behind
  // this value: it only has to be more than common messages have.
  static constexpr std::size_t kMostKept = 1024;

  Ring<std::uint16_t> order_;
  // How many times each fragment is in order_.
  std::vector<std::uint16_t> times_;
};

// What a path still has to send of one message: first copies of the fragments next … count - 1, and
// before these the fragments that are sent again. Owned by a JobQueue, one per message and path,
// which alone takes fragments from it. Plain values; thread-compatible.
struct Job {
  MessageId message{};
  TimePoint deadline{};
  std::uint32_t next = 0;
  std::uint16_t count = 0;
  std::uint16_t chunk = 0;
  AgainList again;

  // Whether the first copy of this fragment has not left yet.
  bool awaits(std::uint16_t index) const { return index >= next && index < count; }
  std::size_t pieces() const { return count - std::min<std::size_t>(next, count) + again.size(); }
  // Those whose first copy has not left yet.
  std::uint32_t firsts() const { return count - std::min<std::uint32_t>(next, count); }
  // The bytes of these fragments, without any header and with all, IP headers included.
  std::size_t bytes() const { return pieces() * chunk; }
  std::size_t ip_bytes() const { return pieces() * ip_bytes_of_piece(chunk); }
  // Calls `what` with the index of each fragment that is still to be sent.
  template <class What>
  void for_each(const What& what) const {
    for (std::size_t i = 0; i < again.size(); ++i) what(again[i]);
    for (std::uint32_t i = next; i < count; ++i) what(static_cast<std::uint16_t>(i));
  }
};

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
  static constexpr std::uint16_t kLastRank = UINT8_MAX;
  // When a job is served among the others.
  struct Turn {
    // Beyond kLastRank: bulk, which all others go before.
    std::uint16_t rank = 0;
    TimePoint deadline{};
    friend auto operator<=>(const Turn&, const Turn&) = default;
  };

  bool empty() const { return order_.empty(); }
  std::size_t size() const { return order_.size(); }
  // Whether nothing but bulk waits.
  bool has_only_bulk() const { return !empty() && order_.begin()->turn.rank > kLastRank; }
  bool has_bulk() const { return !empty() && order_.rbegin()->turn.rank > kLastRank; }

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
  SpareNodes<Order> spare_;
  IdMap<MessageId> by_message_;
  std::uint64_t added_ = 0;
  std::size_t bytes_ = 0;
};

}  // namespace interneuron::flow
