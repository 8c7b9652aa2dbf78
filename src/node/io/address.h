// Converts between Address, a value without meaning to the core, and the system's sockaddr.
// Thread-safe; no errors.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <string>

#include "interneuron/transport.h"

namespace interneuron::io {

static_assert(sizeof(sockaddr_in6) <= sizeof(Address::raw));

// AF_INET, AF_INET6 or AF_UNSPEC.
int family_of(const Address& address);

// The same host at another port.
Address with_port(const Address& address, std::uint16_t port);

// "10.0.0.2" or "fe80::1%eth0": the address without its port and without brackets.
std::string host_text(const Address& address);

// Copies an IPv4 or IPv6 sockaddr of `size` bytes; anything else gives an empty Address. Padding
// and IPv6 flow labels are zeroed, so that equal peers have equal Addresses.
Address from_sockaddr(const sockaddr* source, socklen_t size);

}  // namespace interneuron::io
