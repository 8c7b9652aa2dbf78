// Bounded big-endian reading and writing for this folder's messages. Reading past the end sets a
// flag and yields zero: check ok() once at the end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "interneuron/units.h"

namespace interneuron::perception {

template <class T>
void append(Bytes& out, T value) {
  using U = std::make_unsigned_t<T>;
  const auto bits = static_cast<std::uint64_t>(static_cast<U>(value));
  for (std::size_t i = sizeof(U); i-- > 0;) {
    out.push_back(static_cast<std::byte>((bits >> (8 * i)) & 0xFF));
  }
}

class ByteReader {
 public:
  explicit ByteReader(ByteView in) : in_(in) {}

  template <class T>
  T get() {
    using U = std::make_unsigned_t<T>;
    if (in_.size() < sizeof(U)) {
      ok_ = false;
      in_ = {};
      return T{};
    }
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < sizeof(U); ++i) {
      bits = (bits << 8) | std::to_integer<std::uint64_t>(in_[i]);
    }
    in_ = in_.subspan(sizeof(U));
    return static_cast<T>(static_cast<U>(bits));
  }
  ByteView rest() const { return in_; }
  bool ok() const { return ok_; }

 private:
  ByteView in_;
  bool ok_ = true;
};

}  // namespace interneuron::perception
