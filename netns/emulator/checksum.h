// The Internet checksum (RFC 1071) of UDP and TCP over IPv4 and IPv6.
#pragma once

#include <cstddef>
#include <span>

namespace interneuron::netns {

// Completes the transport checksum of an Ethernet frame whose sender left that to its NIC (the
// field then holds only the sum of the pseudo header). True when done; false when the frame is no
// unfragmented UDP or TCP over IPv4 or IPv6 (without extension headers), and untouched.
bool complete_checksum(std::span<std::byte> frame);

}  // namespace interneuron::netns
