#include "netns/wiring/namespaces.h"

#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>

#include "netns/state/check.h"

namespace interneuron::netns {

namespace {

io::FileDescriptor open_self(const char* path) {
  return io::FileDescriptor(check(::open(path, O_RDONLY | O_CLOEXEC), std::string("open ") + path));
}

// The number in a file of /proc/sys; -1 when there is no such file.
long read_setting(const char* path) {
  std::ifstream file(path);
  long value = -1;
  file >> value;
  return file ? value : -1;
}

// Returns errno, 0 when written.
int write_file(const char* path, const std::string& text) {
  const io::FileDescriptor file(::open(path, O_WRONLY | O_CLOEXEC));
  if (file.get() < 0) return errno;
  return ::write(file.get(), text.data(), text.size()) < 0 ? errno : 0;
}

io::FileDescriptor make_user_namespace() {
  const std::string uid = std::to_string(::geteuid());
  const std::string gid = std::to_string(::getegid());
  if (::unshare(CLONE_NEWUSER) != 0) fail_privilege("make a user namespace", errno);
  // An ordinary user may map a group only after setgroups() has been given up
  // (user_namespaces(7)).
  write_file("/proc/self/setgroups", "deny");
  const int error = write_file("/proc/self/uid_map", "0 " + uid + " 1");
  if (error != 0) fail_privilege("become root of a user namespace", error);
  write_file("/proc/self/gid_map", "0 " + gid + " 1");
  return open_self("/proc/self/ns/user");
}

void unshare_network() {
  if (::unshare(CLONE_NEWNET) != 0) fail_privilege("make a network namespace", errno);
}

// Errors are ignored: in some containers /proc/sys is read-only, and without IPv6 in the kernel
// there are no such files. A testbed works in either case.
void set_ipv6(bool on) {
  const char* disabled = on ? "0" : "1";
  write_file("/proc/sys/net/ipv6/conf/all/disable_ipv6", disabled);
  write_file("/proc/sys/net/ipv6/conf/default/disable_ipv6", disabled);
  // No router advertises itself here, so hosts need neither ask for routers nor accept any.
  write_file("/proc/sys/net/ipv6/conf/default/accept_ra", "0");
  write_file("/proc/sys/net/ipv6/conf/default/router_solicitations", "0");
}

io::FileDescriptor make_network_namespace(bool ipv6) {
  unshare_network();
  set_ipv6(ipv6);
  return open_self("/proc/self/ns/net");
}

}  // namespace

void fail_privilege(const char* attempt, int error) {
  std::string why = std::string("cannot ") + attempt + ": " + std::strerror(error) + "; ";
  if (read_setting("/proc/sys/user/max_user_namespaces") == 0) {
    why += "user.max_user_namespaces is 0: run as root, or `sysctl user.max_user_namespaces=10000`";
  } else if (read_setting("/proc/sys/kernel/unprivileged_userns_clone") == 0) {
    why +=
        "kernel.unprivileged_userns_clone is 0: run as root, or `sysctl "
        "kernel.unprivileged_userns_clone=1`";
  } else if (read_setting("/proc/sys/kernel/apparmor_restrict_unprivileged_userns") == 1) {
    why +=
        "kernel.apparmor_restrict_unprivileged_userns is 1: run as root, or `sysctl "
        "kernel.apparmor_restrict_unprivileged_userns=0`";
  } else {
    why +=
        "a container or a security policy forbids it: run as root with CAP_SYS_ADMIN and "
        "CAP_NET_ADMIN, or allow unprivileged user namespaces";
  }
  throw TestbedError(5, why);
}

Namespaces make_namespaces(std::size_t vehicles, std::size_t roads) {
  Namespaces out;
  // Root within a container may lack CAP_SYS_ADMIN; it then needs a user namespace as ordinary
  // users do.
  const bool direct = ::geteuid() == 0 && ::unshare(CLONE_NEWNET) == 0;
  if (!direct) {
    // What lacks here is room, which a user namespace would not have either.
    if (::geteuid() == 0 && errno == ENOSPC) {
      fail_errno("make a network namespace (more than user.max_net_namespaces allows?)", ENOSPC);
    }
    out.user = make_user_namespace();
    unshare_network();
  }
  set_ipv6(false);
  out.air = open_self("/proc/self/ns/net");
  for (std::size_t i = 0; i < vehicles; ++i) out.vehicles.push_back(make_network_namespace(true));
  for (std::size_t i = 0; i < roads; ++i) out.roads.push_back(make_network_namespace(true));
  out.core = make_network_namespace(true);
  check(::setns(out.air.get(), CLONE_NEWNET), "return to a network namespace");
  return out;
}

int network_of(const Namespaces& namespaces, Host host) {
  switch (host.kind) {
    case Host::Kind::kVehicle:
      return namespaces.vehicles.at(host.index).get();
    case Host::Kind::kRoad:
      return namespaces.roads.at(host.index).get();
    case Host::Kind::kCore:
      break;
  }
  return namespaces.core.get();
}

void enable_forwarding(bool ipv6) {
  // A packet may rightly come in by another NIC than the one that leads back to its source, since
  // the networks of all modems end here. Reverse path filtering would drop it.
  write_file("/proc/sys/net/ipv4/conf/all/rp_filter", "0");
  write_file("/proc/sys/net/ipv4/ip_forward", "1");
  if (!ipv6) return;
  const int error = write_file("/proc/sys/net/ipv6/conf/all/forwarding", "1");
  if (error != 0) fail_errno("let the core route IPv6", error);
}

NetworkNamespaceScope::NetworkNamespaceScope(int network_namespace, int home) : home_(home) {
  check(::setns(network_namespace, CLONE_NEWNET), "enter a network namespace");
}

NetworkNamespaceScope::~NetworkNamespaceScope() {
  // This cannot fail for a namespace that the process holds and came from. If it did, going on in
  // the wrong namespace would be worse than ending.
  if (::setns(home_, CLONE_NEWNET) != 0) ::_exit(1);
}

}  // namespace interneuron::netns
