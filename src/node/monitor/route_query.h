// Asks the kernel whether a socket on a NIC would reach a peer.
#pragma once

#include <optional>

#include "interneuron/transport.h"
#include "node/monitor/netlink.h"

namespace interneuron::io {

// Whether the rules and tables of this namespace route `peer` through the NIC `index`, for a socket
// that is bound to the NIC and, if given, to the address `source`. Unlike sending, this does not
// take a peer without a route for a neighbour (RTM_F_FIB_MATCH, Linux 4.13).
bool is_routed(nl_sock* requests, int index, const Address& peer,
               const std::optional<Address>& source);

}  // namespace interneuron::io
