// What the program `vehicle` sends before an image to the program `road`: the time that it can
// afford for the computation. The header is 8 bytes, big-endian: 2 bytes magic 0x4F46 "OF", 1 byte
// version 1, 1 byte 0, 4 bytes budget in microseconds. Pure functions.
#pragma once

#include <optional>
#include <utility>

#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::offload {

inline constexpr std::size_t kRequestBytes = 8;

// What of a round's deadline `--ladder auto` expects to be left for the computation: half, because
// the way there and back takes the other half on the demo's links.
constexpr Duration ladder_budget(Duration deadline) { return deadline / 2; }

// The header and a copy of the image behind it. A budget that does not fit is clamped to what does:
// 0 to 71 minutes.
Bytes with_request(Duration budget, ByteView image);
// The budget and the image behind it, which is a view into `bytes`; nothing for any bytes that do
// not begin with such a header. Any bytes of a peer are safe.
std::optional<std::pair<Duration, ByteView>> parse_request(ByteView bytes);

}  // namespace interneuron::offload
