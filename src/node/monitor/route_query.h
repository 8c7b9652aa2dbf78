// Asks the kernel whether a socket on a NIC would reach a peer, and drops the kernel's own
// questions for neighbours (ARP, RFC 4861) that nobody has answered.
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

// Drops the unanswered questions of a NIC, so that the next packet asks anew at once. The kernel
// drops a NIC's neighbours itself when it loses its carrier, but what is sent a moment later starts
// a question that is repeated only once a second, also when the carrier is back. Needs
// CAP_NET_ADMIN; returns false, with nothing done, without it.
bool drop_unanswered_neighbours(nl_sock* requests, int index);

}  // namespace interneuron::io
