// What the two ECN bits of an IP header say (RFC 3168, section 5; RFC 9331, section 2): whether the
// sender understands marks, and whether a queue on the way has set one. Plain values. Pure.
#pragma once

#include <cstdint>

namespace interneuron::emu {

enum class Ecn : std::uint8_t {
  // The sender does not understand marks: a queue can only drop the packet.
  kNotEct = 0,
  // The sender understands marks and asks for those of L4S, many and small.
  kEct1 = 1,
  // The sender understands marks and answers one as it would answer a loss.
  kEct0 = 2,
  // A queue has marked the packet: congestion experienced.
  kCe = 3,
};

// Whether a queue may mark the packet instead of dropping it.
constexpr bool is_ect(Ecn ecn) { return ecn != Ecn::kNotEct; }

}  // namespace interneuron::emu
