// A datagram's parts, put together.
#include <cassert>
#include <cstring>

#include "interneuron/endpoint.h"

namespace interneuron {

Transmit TransmitParts::join(std::span<std::byte> buffer) const {
  if (!payload.empty()) {
    assert(size() <= buffer.size());
    std::memmove(&buffer[head + payload.size()], &buffer[head], tail);
    std::memcpy(&buffer[head], payload.data(), payload.size());
  }
  return {link, to, size(), ecn, round};
}

}  // namespace interneuron
