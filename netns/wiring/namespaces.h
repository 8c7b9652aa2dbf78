// Making and entering the namespaces of a testbed.
// Thread-safety: none; these act on the calling thread, and a user namespace needs the process to
// have but one.
#pragma once

#include <cstddef>
#include <vector>

#include "host/io/file_descriptor.h"
#include "netns/state/hosts.h"

namespace interneuron::netns {

struct Namespaces {
  io::FileDescriptor user;                   // empty when the caller's own sufficed
  std::vector<io::FileDescriptor> vehicles;  // one per vehicle
  std::vector<io::FileDescriptor> roads;     // one per roadside unit
  io::FileDescriptor core;                   // routes between the modems' gateways and the units
  io::FileDescriptor air;                    // where the emulator sits
};

// Makes the network namespaces, first a user namespace in which the caller is root if it may not do
// so otherwise, and leaves the caller in `air`. Throws TestbedError (5) that names the setting in
// the way.
Namespaces make_namespaces(std::size_t vehicles, std::size_t roads);

// Of a host that is there.
int network_of(const Namespaces& namespaces, Host host);

// The core's: packets that are for somebody else are passed on. The NICs' own settings matter as
// well (set_up() of netns/wiring/nics.h).
void enable_forwarding(bool ipv6);

// In which network namespace the thread is while this lives; it returns to `home` afterwards.
class NetworkNamespaceScope {
 public:
  NetworkNamespaceScope(int network_namespace, int home);
  ~NetworkNamespaceScope();
  NetworkNamespaceScope(const NetworkNamespaceScope&) = delete;
  NetworkNamespaceScope& operator=(const NetworkNamespaceScope&) = delete;

 private:
  int home_;
};

// Throws TestbedError (5): which setting forbids what was attempted, and how to change it.
[[noreturn]] void fail_privilege(const char* attempt, int error);

}  // namespace interneuron::netns
