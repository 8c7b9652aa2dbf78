#include "netns/wiring/netlink.h"

#include <net/if.h>
#include <netlink/errno.h>

#include <cerrno>

#include "netns/state/check.h"
#include "netns/wiring/namespaces.h"

namespace interneuron::netns::netlink {

void check_nl(int result, const std::string& attempt) {
  if (result >= 0) return;
  // With Ubuntu's AppArmor an ordinary user can make a user namespace but has no rights in it, so
  // that this call is the first to fail.
  if (result == -NLE_PERM) fail_privilege(attempt.c_str(), EPERM);
  throw TestbedError(1, "cannot " + attempt + ": " + nl_geterror(result));
}

Socket open_socket() {
  Socket socket = require(Socket(nl_socket_alloc()));
  check_nl(nl_connect(socket.get(), NETLINK_ROUTE), "open a netlink socket");
  return socket;
}

Link find_link(nl_sock* socket, const std::string& nic) {
  rtnl_link* link = nullptr;
  check_nl(rtnl_link_get_kernel(socket, 0, nic.c_str(), &link), "find the NIC " + nic);
  return Link(link);
}

int nic_index(const std::string& nic) {
  const unsigned index = ::if_nametoindex(nic.c_str());
  if (index == 0) fail_errno("find the NIC " + nic);
  return static_cast<int>(index);
}

Address parse_address(const std::string& text, int family) {
  nl_addr* address = nullptr;
  check_nl(nl_addr_parse(text.c_str(), family, &address), "parse the address " + text);
  return Address(address);
}

int family_of(const std::string& address) {
  return address.find(':') == std::string::npos ? AF_INET : AF_INET6;
}

}  // namespace interneuron::netns::netlink
