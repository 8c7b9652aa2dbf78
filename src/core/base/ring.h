// A queue in one block of memory that grows by doubling and never shrinks: nothing is allocated in
// the steady state, unlike by std::deque, which takes and frees a block every few hundred bytes.
//
// The queue itself has no bound; whoever uses it bounds it. T is default-constructible and copied
// by value; what was popped is overwritten later, not destroyed. References are valid until the
// next push_back(). Thread-compatible; pure.
#pragma once

#include <cassert>
#include <cstddef>
#include <vector>

namespace interneuron {

template <class T>
class Ring {
 public:
  bool empty() const { return size_ == 0; }
  std::size_t size() const { return size_; }

  // The i-th oldest value, i < size().
  T& operator[](std::size_t i) {
    assert(i < size_);
    return slots_[(head_ + i) & mask()];
  }
  const T& operator[](std::size_t i) const {
    assert(i < size_);
    return slots_[(head_ + i) & mask()];
  }
  T& front() { return (*this)[0]; }
  const T& front() const { return (*this)[0]; }
  T& back() { return (*this)[size_ - 1]; }

  void push_back(const T& value) {
    if (size_ == slots_.size()) grow();
    slots_[(head_ + size_) & mask()] = value;
    ++size_;
  }
  void clear() { head_ = size_ = 0; }
  void pop_front() {
    assert(size_ > 0);
    head_ = (head_ + 1) & mask();
    --size_;
  }

 private:
  // A power of two, as every number of slots, so that the remainder is a mask.
  static constexpr std::size_t kFirstSlots = 16;

  std::size_t mask() const { return slots_.size() - 1; }
  void grow() {
    std::vector<T> larger(slots_.empty() ? kFirstSlots : slots_.size() * 2);
    for (std::size_t i = 0; i < size_; ++i) larger[i] = (*this)[i];
    slots_.swap(larger);
    head_ = 0;
  }

  std::vector<T> slots_;
  std::size_t head_ = 0;
  std::size_t size_ = 0;
};

}  // namespace interneuron
