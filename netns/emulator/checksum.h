// The Internet checksum (RFC 1071) of UDP and TCP over IPv4 and IPv6. Pure; thread-safe. The frame
// may hold any bytes: every length in it is checked against its size.
#pragma once

#include <cstddef>
#include <span>

namespace interneuron::netns {

// Computes the transport checksum of an Ethernet frame whose sender left that to its NIC (the field
// then holds only the sum of the pseudo header). Returns false, and leaves the frame as it is,
// unless it is unfragmented UDP or TCP over IPv4 or over IPv6 without extension headers.
bool complete_checksum(std::span<std::byte> frame);

}  // namespace interneuron::netns
