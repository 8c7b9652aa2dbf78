// Memory that all peers of an endpoint share, and who is refused when it runs short.
//
// The rule is that of switches whose ports share one buffer ("Dynamic Queue Length Thresholds for
// Shared-Memory Packet Switches", Choudhury and Hahne): a peer may take more as long as it then
// holds no more than what is left free. So one peer alone gets half of the budget, and n greedy
// ones get a part of n + 1 each, with one such part free for whoever comes next. A peer that holds
// little finds room however greedy the others are, and nothing that was taken is taken back.
//
// Whoever keeps the books of the peers (Peers, HeldMemory) tells it of every change. Endpoints that
// serve one address together (Shard) have one budget: each counts what it holds into the same
// number. Constant time and memory. Pure; thread-compatible.
#pragma once

#include <atomic>
#include <cstddef>

namespace interneuron {

class SharedMemory {
 public:
  // `together`: what others hold of this budget, too; outlives this. nullptr: nobody else does.
  explicit SharedMemory(std::size_t budget_bytes, std::atomic<std::size_t>* together = nullptr)
      : budget_(budget_bytes), together_(together) {}

  // A peer that held `before` bytes holds `after` now.
  void change(std::size_t before, std::size_t after) {
    if (before == after) return;
    if (together_ == nullptr) {
      used_ = used_ - before + after;
    } else {
      together_->fetch_add(after - before, std::memory_order_relaxed);
    }
  }
  // How many bytes more a peer may take that holds so many.
  std::size_t room(std::size_t held) const {
    const std::size_t taken = used() + held;
    return taken < budget_ ? (budget_ - taken) / 2 : 0;
  }
  // Bytes that all peers hold together; never more than the budget, but for what several endpoints
  // take at the same instant.
  std::size_t used() const {
    return together_ == nullptr ? used_ : together_->load(std::memory_order_relaxed);
  }

 private:
  std::size_t budget_ = 0;
  std::size_t used_ = 0;
  std::atomic<std::size_t>* together_ = nullptr;
};

}  // namespace interneuron
