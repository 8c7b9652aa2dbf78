// Makes the NICs of a testbed (nic_plan.h names them) in the namespaces of its hosts: veth pairs,
// addresses, routes and rules, through libnl; and keeps them so. Thread-compatible: acts on the
// calling thread's namespace. Errors: TestbedError.
#pragma once

#include <vector>

#include "netns/state/options.h"
#include "netns/state/state.h"
#include "netns/wiring/namespaces.h"
#include "netns/wiring/netlink.h"
#include "netns/wiring/nic_plan.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

// Makes all NICs that `state` names, and what `options` ask for besides (nat). The caller must be
// in namespaces.air and is there again at the end. All NICs are operational when it returns.
void wire(const State& state, const TestbedOptions& options, const Namespaces& namespaces);

// Restores NICs that come up again: the kernel removes neighbours, routes and IPv6 addresses of a
// NIC that is set down. Elsewhere a network manager restores them; here a test that sets a NIC down
// and up expects it to work as before. Owns two netlink sockets per host. Thread-compatible; driven
// by the holder's loop.
class NicKeeper {
 public:
  // To be made after wire(), with the same arguments and in the same namespace. Throws
  // TestbedError.
  NicKeeper(const State& state, const TestbedOptions& options, const Namespaces& namespaces);

  // fd() is readable when a NIC has changed; serve() then restores those that have come up. It
  // never throws and waits only for the kernel's answers: a NIC that has gone down again, or is
  // gone, is left as it is.
  int fd() const { return changes_.get(); }
  void serve();

 private:
  // A NIC as it was planned, and whether it was up when last seen.
  struct Nic {
    NicPlan plan;
    int index = 0;
    bool up = true;
  };
  struct HostNics {
    netlink::Socket requests;
    netlink::Socket events;
    std::vector<Nic> nics;
  };

  HostNics watch(const HostPlan& host);
  static void serve(HostNics& host);
  static int take_event(nl_msg* message, void* host);

  // An epoll descriptor over the event sockets of all hosts.
  io::FileDescriptor changes_;
  std::vector<HostNics> hosts_;
};

}  // namespace interneuron::netns
