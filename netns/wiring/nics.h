// Making NICs and giving them what their plan says, through libnl. The kernel is never left a
// reason to speak on its own (ARP, neighbour and router discovery, duplicate address detection,
// multicast reports), because every packet on a link counts, and the first starts its time.
// Thread-compatible. Errors: TestbedError (1); (5) for what the kernel forbids.
#pragma once

#include <string>
#include <vector>

#include "netns/wiring/netlink.h"
#include "netns/wiring/nic_plan.h"

namespace interneuron::netns {

// One end of a veth pair.
struct NicEnd {
  std::string nic;
  std::string mac;  // empty: the kernel's choice
  int network_namespace = -1;
  bool multicast = false;
  // The kernel reports the carrier of a veth at once, unless both ends have the same number, when
  // it takes up to a second (linkwatch_urgent_event() of net/core/link_watch.c). 0: any.
  int index = 0;
};

// Both ends are made where they belong, down.
void make_pair(nl_sock* socket, const NicEnd& a, const NicEnd& b);

// No link-local address; up. Of the socket's and the caller's namespace.
void set_up(nl_sock* socket, const std::string& nic, bool forwards = false);

// Segmentation offloads off, up, and `configure`.
void set_up(nl_sock* socket, const NicPlan& plan);

// Addresses, neighbours, routes and rules of a NIC that is up. What is there already stays.
void configure(nl_sock* socket, const NicPlan& plan, int index);

// The kernel reports a carrier some time after both ends are up, and finishes IPv6 addresses in the
// background: waits until all NICs of the socket's namespace are operational, and these addresses
// reachable, for 5 s at most.
void await_operational(nl_sock* socket, const std::vector<NicPlan>& plans);

}  // namespace interneuron::netns
