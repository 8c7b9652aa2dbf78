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

// First copies of the fragments next … count - 1, and before these the fragments that are sent
// again. Owned by the Sender, one per message and path. Plain values; thread-compatible.
struct Job {
  MessageId message{};
  TimePoint deadline{};
  std::uint32_t next = 0;
  std::uint16_t count = 0;
  std::uint16_t chunk = 0;
  Ring<std::uint16_t> again;

  std::size_t pieces() const { return count - std::min<std::size_t>(next, count) + again.size(); }
  // Of fragments, and of packets with IP headers.
  std::size_t bytes() const { return pieces() * chunk; }
  std::size_t ip_bytes() const { return pieces() * (chunk + kPieceOverheadBytes + kIpUdpBytes); }
  bool is_again(std::uint16_t index) const {
    for (std::size_t i = 0; i < again.size(); ++i) {
      if (again[i] == index) return true;
    }
    return false;
  }
  // Calls `what` with the index of each fragment that is still to be sent.
  template <class What>
  void for_each(const What& what) const {
    for (std::size_t i = 0; i < again.size(); ++i) what(again[i]);
    for (std::uint32_t i = next; i < count; ++i) what(static_cast<std::uint16_t>(i));
  }
  std::vector<std::uint16_t> owed() const {
    std::vector<std::uint16_t> out;
    for_each([&out](std::uint16_t index) { out.push_back(index); });
    return out;
  }
};

}  // namespace interneuron::flow
