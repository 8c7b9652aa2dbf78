// Address translation and a stateful firewall in the core, as a carrier's gateway has them, by
// nftables. Thread-compatible. Errors: TestbedError (1) where the kernel cannot do it.
#pragma once

#include <cstddef>

namespace interneuron::netns {

// Sets both up in the current network namespace, which must be the core's. Packets that vehicles'
// modems on network n send to roadside units leave with the core's own IPv4 address on that
// network; IPv6 addresses are not translated. A roadside unit cannot open a flow to a vehicle, by
// IPv4 or IPv6; vehicles reach one another as before. The kernel forgets a mapping that is idle for
// net.netfilter.nf_conntrack_udp_timeout (30 s), or for ..._udp_timeout_stream (120 s) once there
// has been traffic both ways; both can be set in the core.
void set_up_nat(std::size_t networks);

}  // namespace interneuron::netns
