// Bounded reading and writing of integers in network byte order (big-endian). Neither class throws
// or allocates; both hold a view, so the bytes must outlive them. Pure; thread-compatible.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "interneuron/units.h"

namespace interneuron::wire {

// The value whose bytes in memory are those of `bits` in network byte order, and back. A byte at a
// time the compiler would have to write the place in the buffer back after each, because a byte may
// be a part of anything.
template <class U>
constexpr U network_order(U bits) {
  static_assert(std::is_unsigned_v<U> && sizeof(U) <= 8);
  if constexpr (sizeof(U) == 1 || std::endian::native == std::endian::big) {
    return bits;
  } else if constexpr (sizeof(U) == 2) {
    return __builtin_bswap16(bits);
  } else if constexpr (sizeof(U) == 4) {
    return __builtin_bswap32(bits);
  } else {
    return __builtin_bswap64(bits);
  }
}

// Writes into a buffer of ours. What does not fit is not written and makes ok() false for good:
// every caller asserts ok(), because a buffer that is too small is our own bug.
class Writer {
 public:
  explicit Writer(std::span<std::byte> out) : out_(out) {}

  template <class T>
  void put(T value) {
    using U = std::make_unsigned_t<T>;
    if (out_.size() - at_ < sizeof(U)) {
      ok_ = false;
      return;
    }
    const U bits = network_order(static_cast<U>(value));
    std::memcpy(out_.data() + at_, &bits, sizeof(U));
    at_ += sizeof(U);
  }
  void put_bytes(ByteView bytes) {
    if (out_.size() - at_ < bytes.size()) {
      ok_ = false;
      return;
    }
    if (!bytes.empty()) std::memcpy(out_.data() + at_, bytes.data(), bytes.size());
    at_ += bytes.size();
  }
  void put_zeros(std::size_t count) {
    if (out_.size() - at_ < count) {
      ok_ = false;
      return;
    }
    std::memset(out_.data() + at_, 0, count);
    at_ += count;
  }
  std::size_t size() const { return at_; }
  bool ok() const { return ok_; }

 private:
  std::span<std::byte> out_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

// Reads bytes that a peer sent. A value that would reach past the end is read as 0 and makes ok()
// false for good, so that a parser may read all its fields first and ask once. The values
// themselves are not judged: every range is the parser's to check.
class Reader {
 public:
  explicit Reader(ByteView in) : in_(in) {}

  template <class T>
  T get() {
    using U = std::make_unsigned_t<T>;
    if (in_.size() - at_ < sizeof(U)) {
      ok_ = false;
      at_ = in_.size();
      return T{};
    }
    U bits = 0;
    std::memcpy(&bits, in_.data() + at_, sizeof(U));
    at_ += sizeof(U);
    return static_cast<T>(network_order(bits));
  }
  ByteView rest() const { return in_.subspan(at_); }
  bool ok() const { return ok_; }
  bool at_end() const { return at_ == in_.size(); }

 private:
  ByteView in_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace interneuron::wire
