// The first bytes of every message that two programs exchange, whatever transport carries it: which
// message it is, and how long, which a stream needs to find its end. Big-endian. The reader checks
// the size; both ends are this program. Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "interneuron/message.h"

namespace interneuron::transports {

struct MessageHead {
  std::uint32_t vehicle = 0;
  // Counts within the vehicle.
  std::uint32_t number = 0;
  // The length of the whole message, with this head.
  std::uint32_t bytes = 0;
};
inline constexpr std::size_t kMessageHeadBytes = 12;

namespace head_detail {

inline void put(std::byte* at, std::uint32_t value) {
  for (int i = 3; i >= 0; --i, value >>= 8U) at[i] = static_cast<std::byte>(value & 0xffU);
}
inline std::uint32_t get(const std::byte* at) {
  std::uint32_t value = 0;
  for (int i = 0; i < 4; ++i) value = value << 8U | std::to_integer<std::uint32_t>(at[i]);
  return value;
}

}  // namespace head_detail

// Writes kMessageHeadBytes.
inline void write_head(std::byte* at, const MessageHead& head) {
  head_detail::put(at, head.vehicle);
  head_detail::put(at + 4, head.number);
  head_detail::put(at + 8, head.bytes);
}

// Nothing when there are too few bytes.
inline std::optional<MessageHead> read_head(ByteView bytes) {
  if (bytes.size() < kMessageHeadBytes) return std::nullopt;
  return MessageHead{head_detail::get(bytes.data()), head_detail::get(bytes.data() + 4),
                     head_detail::get(bytes.data() + 8)};
}

// A message of so many bytes, at least kMessageHeadBytes: the head and zeros.
inline Bytes message_of(std::uint32_t vehicle, std::uint32_t number, std::size_t bytes) {
  Bytes out(bytes);
  write_head(out.data(), {vehicle, number, static_cast<std::uint32_t>(bytes)});
  return out;
}

}  // namespace interneuron::transports
