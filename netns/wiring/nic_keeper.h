// Gives NICs back what the kernel takes from them when somebody sets them down: neighbours, routes
// and IPv6 addresses. Elsewhere a network manager does that; here whoever tries a NIC's failure
// expects it to work again once it is up. Thread-compatible.
#pragma once

#include <vector>

#include "host/io/file_descriptor.h"
#include "netns/wiring/namespaces.h"
#include "netns/wiring/netlink.h"
#include "netns/wiring/nic_plan.h"

namespace interneuron::netns {

class NicKeeper {
 public:
  // After wire(), with the same arguments and in the same namespace. Throws TestbedError.
  NicKeeper(const State& state, const TestbedOptions& options, const Namespaces& namespaces);

  // Readable when a NIC has changed; serve() looks which. Never blocks for long, never throws.
  int fd() const { return changes_.get(); }
  void serve();

 private:
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

  io::FileDescriptor changes_;  // epoll, of all hosts' events
  std::vector<HostNics> hosts_;
};

}  // namespace interneuron::netns
