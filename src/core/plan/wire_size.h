// What a message costs on the wire: its own bytes plus the headers of its packets. Pure.
#pragma once

#include <cstddef>

namespace interneuron {

// Fragment, packet, UDP and IPv4 headers around each 1,352 bytes of a message
// (docs/wire_format.md).
inline constexpr double kWireOverhead = 1428.0 / 1352.0;

constexpr std::size_t wire_size(std::size_t bytes) {
  return static_cast<std::size_t>(static_cast<double>(bytes) * kWireOverhead);
}

}  // namespace interneuron
