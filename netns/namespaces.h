// Making and entering the namespaces of a testbed.
// Thread-safety: none; these act on the calling thread, and a user namespace needs the process to
// have but one.
#pragma once

#include "io/file_descriptor.h"

namespace interneuron::netns {

struct Namespaces {
  io::FileDescriptor user;  // empty when the caller's own sufficed
  io::FileDescriptor vehicle;
  io::FileDescriptor road;
  io::FileDescriptor middle;
};

// Makes the network namespaces, first a user namespace in which the caller is root if it may not do
// so otherwise, and leaves the caller in the middle one. In all of them IPv6 is off, as its own
// packets would be taken for traffic. Throws TestbedError (5) that names the setting in the way.
Namespaces make_namespaces();

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
