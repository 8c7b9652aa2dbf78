// Makes and enters the namespaces of a testbed. These functions change the calling thread, and the
// kernel makes a user namespace only for a process with one thread, so they are meant for the
// holder. Errors: TestbedError.
#pragma once

#include <cstddef>
#include <vector>

#include "netns/state/hosts.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

// The namespaces of one testbed. The descriptors keep them alive.
struct Namespaces {
  // Empty when the caller had the right to make network namespaces without one.
  io::FileDescriptor user;
  // Network namespaces: one per vehicle, one per roadside unit.
  std::vector<io::FileDescriptor> vehicles;
  std::vector<io::FileDescriptor> roads;
  // The one that routes between the modems' gateways and the roadside units.
  io::FileDescriptor core;
  // The one in which the emulator works.
  io::FileDescriptor air;
};

// Makes the network namespaces and leaves the caller in `air`. A caller who may not do so first
// gets a user namespace, in which it is root. Throws TestbedError (5), which names the system
// setting that forbids it.
Namespaces make_namespaces(std::size_t vehicles, std::size_t roads);

// The descriptor of a host's network namespace; the host must exist.
int network_of(const Namespaces& namespaces, Host host);

// Makes the current network namespace, the core, forward packets. The settings of its NICs must
// allow that as well (set_up() of netns/wiring/nics.h).
void enable_forwarding(bool ipv6);

// While this lives the thread is in `network_namespace`; the destructor takes it back to `home`,
// and ends the process if the kernel refuses that. The constructor throws TestbedError.
class NetworkNamespaceScope {
 public:
  NetworkNamespaceScope(int network_namespace, int home);
  ~NetworkNamespaceScope();
  NetworkNamespaceScope(const NetworkNamespaceScope&) = delete;
  NetworkNamespaceScope& operator=(const NetworkNamespaceScope&) = delete;

 private:
  int home_;
};

// Throws TestbedError (5), which says what system setting forbids `attempt` and how to change it.
[[noreturn]] void fail_privilege(const char* attempt, int error);

}  // namespace interneuron::netns
