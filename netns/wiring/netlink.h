// The calls of libnl's routing netlink that several files of the testbed need, with the owning
// pointers of src/node/monitor/netlink.h. A socket acts on the network namespace in which it was
// opened. Thread-compatible. Errors: TestbedError (1), or (5) for what the kernel forbids.
#pragma once

#include <string>

#include "node/monitor/netlink.h"

namespace interneuron::netns::netlink {

using io::netlink::Address;
using io::netlink::Deleter;
using io::netlink::Link;
using io::netlink::Socket;

// Throws when `result` is negative, which is an error of libnl; the text says "cannot ATTEMPT".
void check_nl(int result, const std::string& attempt);

// Returns `object`; throws when it is empty because its allocation failed.
template <class Owner>
Owner require(Owner object) {
  if (!object) check_nl(-NLE_NOMEM, "talk to the kernel");
  return object;
}

// A socket that acts on the current network namespace.
Socket open_socket();

// A NIC by name, as the kernel describes it.
Link find_link(nl_sock* socket, const std::string& nic);

// The number of a NIC of the current network namespace.
int nic_index(const std::string& nic);

// Parses "10.77.1.2", "10.77.1.0/24", "fd77:0:1:1::2" or, with AF_LLC, "02:77:01:01:00:01". Throws
// for anything else.
Address parse_address(const std::string& text, int family);

// AF_INET, or AF_INET6 for a text with a colon.
int family_of(const std::string& address);

}  // namespace interneuron::netns::netlink
