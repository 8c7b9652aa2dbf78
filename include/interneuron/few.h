// A list of at most N values, stored in place: nothing is allocated, so that a decision about a
// message costs no call of the heap. What does not fit is left out without an error. T must be
// trivially copyable, so that copying never throws: what holds a list beside memory of its own is
// then moved, not copied, by a vector that grows. An index out of range is asserted. Pure;
// thread-compatible.
#pragma once

#include <cassert>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <type_traits>

namespace interneuron {

template <class T, std::size_t N>
class Few {
  static_assert(std::is_trivially_copyable_v<T> && N > 0);

 public:
  using value_type = T;
  using size_type = std::size_t;
  using difference_type = std::ptrdiff_t;
  using reference = T&;
  using const_reference = const T&;
  using iterator = T*;
  using const_iterator = const T*;

  Few() noexcept {}
  Few(std::initializer_list<T> values) {
    for (const T& value : values) push_back(value);
  }
  Few(const Few& other) noexcept : size_(other.size_) {
    std::uninitialized_copy_n(other.values_, size_, values_);
  }
  Few& operator=(const Few& other) noexcept {
    if (this == &other) return *this;
    size_ = other.size_;
    std::uninitialized_copy_n(other.values_, size_, values_);
    return *this;
  }
  ~Few() = default;

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T* data() { return values_; }
  const T* data() const { return values_; }
  T* begin() { return values_; }
  const T* begin() const { return values_; }
  T* end() { return values_ + size_; }
  const T* end() const { return values_ + size_; }
  T& operator[](std::size_t i) {
    assert(i < size_);
    return values_[i];
  }
  const T& operator[](std::size_t i) const {
    assert(i < size_);
    return values_[i];
  }
  T& front() { return (*this)[0]; }
  const T& front() const { return (*this)[0]; }
  T& back() { return (*this)[size_ - 1]; }
  const T& back() const { return (*this)[size_ - 1]; }

  // False when there is no room; the list is then unchanged.
  bool push_back(const T& value) {
    if (size_ == N) return false;
    std::construct_at(values_ + size_, value);
    ++size_;
    return true;
  }
  // Inserts in front of position `at` <= size(). When there is no room, the last value is dropped.
  void insert(std::size_t at, const T& value) {
    assert(at <= size_);
    if (at == N) return;
    if (size_ < N) ++size_;
    for (std::size_t i = size_ - 1; i > at; --i) std::construct_at(values_ + i, values_[i - 1]);
    std::construct_at(values_ + at, value);
  }

  friend bool operator==(const Few& a, const Few& b) {
    if (a.size_ != b.size_) return false;
    for (std::size_t i = 0; i < a.size_; ++i) {
      if (!(a.values_[i] == b.values_[i])) return false;
    }
    return true;
  }

 private:
  std::size_t size_ = 0;
  // A union, so that only the first size_ values are ever constructed.
  union {
    T values_[N];
  };
};

}  // namespace interneuron
