// The two ECN bits of an IP packet (RFC 3168, section 5). The packet is IPv4 or IPv6 and holds all
// of its header without options, which the caller has checked. Pure functions.
#pragma once

#include <cstddef>
#include <span>

#include "lab/emu/queue.h"

namespace interneuron::netns {

emu::Ecn ecn_of(std::span<const std::byte> packet);
// Sets the bits to CE; of IPv4 the header's checksum follows.
void mark_congestion(std::span<std::byte> packet);

}  // namespace interneuron::netns
