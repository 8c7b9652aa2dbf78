// What the vehicle program puts before an image for the road program: the time it can afford for
// the computation. Big-endian: 2 bytes magic 0x4F46 "OF", 1 byte version 1, 1 byte 0, 4 bytes
// budget in microseconds. Pure.
#pragma once

#include <optional>
#include <utility>

#include "interneuron/units.h"

namespace interneuron::cli {

inline constexpr std::size_t kRequestBytes = 8;

Bytes with_request(Duration budget, ByteView image);
// The budget and the image behind it; nothing for any other bytes.
std::optional<std::pair<Duration, ByteView>> parse_request(ByteView bytes);

}  // namespace interneuron::cli
