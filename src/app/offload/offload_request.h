// What the vehicle program puts before an image for the road program: the time it can afford for
// the computation. Big-endian: 2 bytes magic 0x4F46 "OF", 1 byte version 1, 1 byte 0, 4 bytes
// budget in microseconds. Pure.
#pragma once

#include <optional>
#include <utility>

#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::cli {

inline constexpr std::size_t kRequestBytes = 8;

// What of a round's deadline `--ladder auto` expects to be left for the computation: half, because
// the way there and back takes the other half on the demo's links.
constexpr Duration ladder_budget(Duration deadline) { return deadline / 2; }

Bytes with_request(Duration budget, ByteView image);
// The budget and the image behind it; nothing for any other bytes.
std::optional<std::pair<Duration, ByteView>> parse_request(ByteView bytes);

}  // namespace interneuron::cli
