// Bytes as libsodium wants them, which calls them unsigned char: what it reads, and where it
// writes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "interneuron/units.h"

namespace interneuron::crypto {

inline unsigned char* target(std::span<std::byte> bytes) {
  return reinterpret_cast<unsigned char*>(bytes.data());
}
inline const unsigned char* raw(ByteView bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}
// The bytes of a text without its terminating zero.
inline ByteView bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

}  // namespace interneuron::crypto
