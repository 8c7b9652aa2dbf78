// What a path still has to send of one message.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/base/ring.h"
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

// First copies of the fragments next … count - 1, and before these the fragments that are sent
// again. Owned by a JobQueue, one per message and path, which alone takes fragments from it. Plain
// values; thread-compatible.
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

}  // namespace interneuron::flow
