// The input of a fuzz target as a sequence of numbers: what libFuzzer mutates byte by byte, taken
// apart from the front. Reading behind the end gives zeros, so that every input means something and
// a longer one begins like the shorter. Holds a view; pure; thread-compatible.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>

#include "interneuron/units.h"

namespace interneuron::fuzz {

class Input {
 public:
  explicit Input(std::span<const std::uint8_t> bytes) : left_(bytes) {}

  bool empty() const { return left_.empty(); }

  // The next number, little-endian.
  template <class T>
  T take() {
    std::uint64_t value = 0;
    const std::size_t size = std::min(sizeof(T), left_.size());
    for (std::size_t i = 0; i < size; ++i) value |= std::uint64_t{left_[i]} << (8 * i);
    left_ = left_.subspan(size);
    return static_cast<T>(value);
  }
  // 0 … n - 1 for an n of 1 … 256, from one byte.
  std::size_t below(std::size_t n) { return take<std::uint8_t>() % n; }
  bool flip() { return (take<std::uint8_t>() & 1U) != 0; }
  // One of these values, or any value of the type: the values that matter are met often.
  template <class T, std::size_t N>
  T one_of(const T (&likely)[N]) {
    const std::size_t which = below(N + 1);
    return which < N ? likely[which] : take<T>();
  }
  // The next bytes, at most as many as there are.
  ByteView bytes(std::size_t size) {
    const auto out = left_.first(std::min(size, left_.size()));
    left_ = left_.subspan(out.size());
    return std::as_bytes(out);
  }
  // All that is left, as text.
  std::string_view text() {
    const auto out = left_;
    left_ = {};
    return {reinterpret_cast<const char*>(out.data()), out.size()};
  }

 private:
  std::span<const std::uint8_t> left_;
};

// The whole input as text.
inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

}  // namespace interneuron::fuzz
