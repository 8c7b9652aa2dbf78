// Bounded reading and writing of integers in network byte order (big-endian). Neither class throws
// or allocates; both hold a view, so the bytes must outlive them. Pure; thread-compatible.
#pragma once

#include <cstring>
#include <span>
#include <type_traits>

#include "interneuron/units.h"

namespace interneuron::wire {

// Writes into a buffer of ours. What does not fit is not written and makes ok() false for good:
// every caller asserts ok(), because a buffer that is too small is our own bug.
class Writer {
 public:
  explicit Writer(std::span<std::byte> out) : out_(out) {}

  template <class T>
  void put(T value) {
    using U = std::make_unsigned_t<T>;
    const auto bits = static_cast<U>(value);
    if (out_.size() - at_ < sizeof(U)) {
      ok_ = false;
      return;
    }
    for (std::size_t i = 0; i < sizeof(U); ++i) {
      out_[at_++] = static_cast<std::byte>(bits >> (8 * (sizeof(U) - 1 - i)));
    }
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
    for (std::size_t i = 0; i < sizeof(U); ++i) {
      bits = static_cast<U>((static_cast<std::uint64_t>(bits) << 8) |
                            std::to_integer<std::uint64_t>(in_[at_++]));
    }
    return static_cast<T>(bits);
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
