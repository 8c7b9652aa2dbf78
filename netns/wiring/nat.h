// A carrier's gateway: address translation and a stateful firewall in the core, by nftables.
#pragma once

#include <cstddef>

namespace interneuron::netns {

// In the current network namespace, which is the core's. What the vehicles' modems on network n
// send to roadside units leaves with the core's own address there; IPv6 keeps its addresses. No
// roadside unit can open a flow to a vehicle, in either family; vehicles reach one another as
// before. Idle mappings are forgotten after net.netfilter.nf_conntrack_udp_timeout (30 s) and
// ..._udp_timeout_stream (120 s), which may be set there.
// Throws TestbedError (1) where the kernel cannot.
void set_up_nat(std::size_t networks);

}  // namespace interneuron::netns
