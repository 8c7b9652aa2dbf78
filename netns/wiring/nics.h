// Makes NICs and gives them what their plan (nic_plan.h) says, through libnl. All settings that
// make the kernel send packets of its own (ARP, neighbour and router discovery, duplicate address
// detection, multicast reports) are turned off: every packet on a link is counted, and the first
// one begins the links' time. Thread-compatible. Errors: TestbedError (1), or (5) for what the
// kernel forbids.
#pragma once

#include <string>
#include <vector>

#include "netns/wiring/netlink.h"
#include "netns/wiring/nic_plan.h"

namespace interneuron::netns {

// One end of a veth pair.
struct NicEnd {
  std::string nic;
  // Empty leaves it to the kernel.
  std::string mac;
  int network_namespace = -1;
  bool multicast = false;
  // The NIC's number; 0 leaves it to the kernel. The two ends need different numbers: with the same
  // one the kernel reports the carrier up to a second late (linkwatch_urgent_event() of
  // net/core/link_watch.c).
  int index = 0;
};

// Makes both ends in their namespaces, down.
void make_pair(nl_sock* socket, const NicEnd& a, const NicEnd& b);

// Sets a NIC up, without a link-local address. Socket and caller must be in the NIC's namespace.
void set_up(nl_sock* socket, const std::string& nic, bool forwards = false);

// Turns segmentation offloads off, sets the NIC up and configures it.
void set_up(nl_sock* socket, const NicPlan& plan);

// Gives a NIC that is up its addresses, neighbours, routes and rules; those it has already stay.
void configure(nl_sock* socket, const NicPlan& plan, int index);

// Waits until all these NICs of the socket's namespace are operational and their addresses
// reachable: the kernel reports a carrier some time after both ends are up and finishes IPv6
// addresses in the background. Throws after 5 s.
void await_operational(nl_sock* socket, const std::vector<NicPlan>& plans);

}  // namespace interneuron::netns
