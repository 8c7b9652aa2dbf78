// The kernel's routing netlink through libnl: the calls that every user of it here needs, with the
// owners of host/io/netlink.h. Objects belong to the network namespace in which their socket was
// opened. Thread-compatible. Errors: TestbedError (1); (5) for what the kernel forbids.
#pragma once

#include <string>

#include "host/io/netlink.h"

namespace interneuron::netns::netlink {

using io::netlink::Address;
using io::netlink::Deleter;
using io::netlink::Link;
using io::netlink::Socket;

// Throws when `result` is negative, an error of libnl.
void check_nl(int result, const std::string& attempt);

// `object`, unless its allocation failed.
template <class Owner>
Owner require(Owner object) {
  if (!object) check_nl(-NLE_NOMEM, "talk to the kernel");
  return object;
}

// To the current network namespace.
Socket open_socket();

// A NIC by name, as the kernel describes it.
Link find_link(nl_sock* socket, const std::string& nic);

// The number of a NIC of the current network namespace.
int nic_index(const std::string& nic);

// "10.77.1.2", "10.77.1.0/24", "fd77:0:1:1::2", or, with AF_LLC, "02:77:01:01:00:01".
Address parse_address(const std::string& text, int family);

// AF_INET or AF_INET6.
int family_of(const std::string& address);

}  // namespace interneuron::netns::netlink
