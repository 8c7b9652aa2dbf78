// The kernel's questions for neighbours (ARP, RFC 4861) that nobody has answered.
#pragma once

#include "node/monitor/netlink.h"

namespace interneuron::io {

// Drops those of a NIC, so that the next packet asks anew at once. The kernel drops a NIC's
// neighbours itself when it loses its carrier, but what is sent a moment later starts a question
// that is repeated only once a second, also when the carrier is back. Needs CAP_NET_ADMIN; returns
// false, with nothing done, without it.
bool drop_unanswered_neighbours(nl_sock* requests, int index);

}  // namespace interneuron::io
