// Memory that all peers of an endpoint share, and who is refused when it runs short.
//
// The rule is that of switches whose ports share one buffer ("Dynamic Queue Length Thresholds for
// Shared-Memory Packet Switches", Choudhury and Hahne): a peer may take more as long as it then
// holds no more than what is left free. So one peer alone gets half of the budget, and n greedy
// ones get a part of n + 1 each, with one such part free for whoever comes next. A peer that holds
// little finds room however greedy the others are, and nothing that was taken is taken back.
//
// Whoever keeps the books of the peers (Peers, HeldMemory) tells it of every change. Constant
// time and memory. Pure; thread-compatible.
#pragma once

#include <cstddef>

namespace interneuron {

class SharedMemory {
 public:
  explicit SharedMemory(std::size_t budget_bytes) : budget_(budget_bytes) {}

  // A peer that held `before` bytes holds `after` now.
  void change(std::size_t before, std::size_t after) { used_ = used_ - before + after; }
  // How many bytes more a peer may take that holds so many.
  std::size_t room(std::size_t held) const {
    return used_ + held < budget_ ? (budget_ - used_ - held) / 2 : 0;
  }
  // Bytes that all peers hold together; never more than the budget.
  std::size_t used() const { return used_; }

 private:
  std::size_t budget_ = 0;
  std::size_t used_ = 0;
};

}  // namespace interneuron
