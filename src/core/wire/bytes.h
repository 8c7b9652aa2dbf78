// Bounded big-endian reading and writing. Reading past the end sets a flag and yields zero: check
// ok() once at the end.
#pragma once

#include <cstring>
#include <span>
#include <type_traits>

#include "interneuron/units.h"

namespace interneuron::wire {

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
