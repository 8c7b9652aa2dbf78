#include "netns/wiring.h"

#include <linux/if.h>
#include <linux/neighbour.h>
#include <netlink/addr.h>
#include <netlink/netlink.h>
#include <netlink/route/addr.h>
#include <netlink/route/link.h>
#include <netlink/route/link/veth.h>
#include <netlink/route/neighbour.h>
#include <poll.h>
#include <time.h>

#include <array>
#include <memory>

#include "netns/check.h"
#include "netns/offloads.h"

namespace interneuron::netns {

namespace {

constexpr unsigned kMtu = 1500;  // bytes, Ethernet
constexpr int kOperationalBoundMs = 5000;

template <auto Function>
struct Deleter {
  template <class T>
  void operator()(T* object) const {
    Function(object);
  }
};
using Socket = std::unique_ptr<nl_sock, Deleter<nl_socket_free>>;
using Link = std::unique_ptr<rtnl_link, Deleter<rtnl_link_put>>;
using Veth = std::unique_ptr<rtnl_link, Deleter<rtnl_link_veth_release>>;
using LinkAddress = std::unique_ptr<nl_addr, Deleter<nl_addr_put>>;
using NicAddress = std::unique_ptr<rtnl_addr, Deleter<rtnl_addr_put>>;
using Neighbour = std::unique_ptr<rtnl_neigh, Deleter<rtnl_neigh_put>>;

[[noreturn]] void out_of_memory() { throw TestbedError(1, "out of memory"); }

void check_nl(int result, const std::string& attempt) {
  if (result >= 0) return;
  // Ubuntu's AppArmor lets a user namespace be made, but without rights in it.
  if (result == -NLE_PERM) fail_privilege(attempt.c_str(), EPERM);
  throw TestbedError(1, "cannot " + attempt + ": " + nl_geterror(result));
}

Socket open_socket() {
  Socket socket(nl_socket_alloc());
  if (!socket) out_of_memory();
  check_nl(nl_connect(socket.get(), NETLINK_ROUTE), "open a netlink socket");
  return socket;
}

LinkAddress parse_address(const std::string& text, int family) {
  nl_addr* address = nullptr;
  check_nl(nl_addr_parse(text.c_str(), family, &address), "parse the address " + text);
  return LinkAddress(address);
}

Link find_link(nl_sock* socket, const std::string& nic) {
  rtnl_link* link = nullptr;
  check_nl(rtnl_link_get_kernel(socket, 0, nic.c_str(), &link), "find the NIC " + nic);
  return Link(link);
}

// Known MAC addresses, locally administered, so that neighbours can be set without asking: ARP
// would cross the emulated link and double the delay of the first packets.
std::string mac_of(std::size_t position, Side side) {
  std::array<char, 18> text{};
  std::snprintf(text.data(), text.size(), "02:77:00:00:%02x:%02x",
                static_cast<unsigned>(position + 1) & 0xffU, side == Side::kVehicle ? 1U : 2U);
  return text.data();
}

// One veth pair from the middle namespace, where the caller is, into an application's.
void make_pair(nl_sock* socket, const std::string& port, const std::string& nic,
               const std::string& mac, int application_namespace) {
  Veth veth(rtnl_link_veth_alloc());
  if (!veth) out_of_memory();
  // Borrowed: belongs to the pair. (It takes a reference, which the second owner gives back.)
  const Link peer(rtnl_link_veth_get_peer(veth.get()));
  rtnl_link_set_name(veth.get(), port.c_str());
  rtnl_link_set_mtu(veth.get(), kMtu);
  rtnl_link_set_name(peer.get(), nic.c_str());
  rtnl_link_set_mtu(peer.get(), kMtu);
  rtnl_link_set_addr(peer.get(), parse_address(mac, AF_LLC).get());
  rtnl_link_set_ns_fd(peer.get(), application_namespace);
  const int result = rtnl_link_add(socket, veth.get(), NLM_F_CREATE | NLM_F_EXCL);
  if (result == -NLE_OPNOTSUPP) {
    throw TestbedError(1, "cannot make the veth pair " + port +
                              ": the kernel has no veth; `modprobe veth` as root loads it");
  }
  check_nl(result, "make the veth pair " + port);
}

void set_up(nl_sock* socket, const std::string& nic) {
  const Link link = find_link(socket, nic);
  const Link change(rtnl_link_alloc());
  if (!change) out_of_memory();
  rtnl_link_set_flags(change.get(), IFF_UP);
  check_nl(rtnl_link_change(socket, link.get(), change.get(), 0), "set " + nic + " up");
}

void add_address(nl_sock* socket, const std::string& nic, const std::string& address) {
  const Link link = find_link(socket, nic);
  const NicAddress entry(rtnl_addr_alloc());
  if (!entry) out_of_memory();
  const LinkAddress local = parse_address(address + "/24", AF_INET);
  rtnl_addr_set_ifindex(entry.get(), rtnl_link_get_ifindex(link.get()));
  check_nl(rtnl_addr_set_local(entry.get(), local.get()), "use the address " + address);
  check_nl(rtnl_addr_add(socket, entry.get(), 0), "give " + nic + " the address " + address);
}

void add_neighbour(nl_sock* socket, const std::string& nic, const std::string& address,
                   const std::string& mac) {
  const Link link = find_link(socket, nic);
  const Neighbour entry(rtnl_neigh_alloc());
  if (!entry) out_of_memory();
  const LinkAddress destination = parse_address(address, AF_INET);
  const LinkAddress hardware = parse_address(mac, AF_LLC);
  rtnl_neigh_set_ifindex(entry.get(), rtnl_link_get_ifindex(link.get()));
  check_nl(rtnl_neigh_set_dst(entry.get(), destination.get()), "use the neighbour " + address);
  rtnl_neigh_set_lladdr(entry.get(), hardware.get());
  rtnl_neigh_set_state(entry.get(), NUD_PERMANENT);
  check_nl(rtnl_neigh_add(socket, entry.get(), NLM_F_CREATE | NLM_F_REPLACE),
           "add the neighbour " + address + " of " + nic);
}

void configure_side(const std::vector<TestbedLink>& links, Side side) {
  const Socket socket = open_socket();
  set_up(socket.get(), "lo");
  const Side other = side == Side::kVehicle ? Side::kRoad : Side::kVehicle;
  for (std::size_t i = 0; i < links.size(); ++i) {
    const TestbedLink& link = links[i];
    const bool vehicle = side == Side::kVehicle;
    disable_segmentation_offloads(link.nic);
    set_up(socket.get(), link.nic);
    add_address(socket.get(), link.nic, vehicle ? link.vehicle_address : link.road_address);
    add_neighbour(socket.get(), link.nic, vehicle ? link.road_address : link.vehicle_address,
                  mac_of(i, other));
  }
}

bool operational(nl_sock* socket, const std::string& nic) {
  return rtnl_link_get_operstate(find_link(socket, nic).get()) == IF_OPER_UP;
}

// The kernel reports a carrier some time after both ends are up; there is nothing to hurry it with
// but to look again.
void await_operational(const std::vector<TestbedLink>& links) {
  const Socket socket = open_socket();
  int waited_ms = 0;
  for (const TestbedLink& link : links) {
    while (!operational(socket.get(), link.nic)) {
      if (++waited_ms > kOperationalBoundMs) {
        throw TestbedError(1, link.nic + " is not operational after 5 s");
      }
      ::poll(nullptr, 0, 1);
    }
  }
}

}  // namespace

std::string vehicle_port(const std::string& link_name) { return "v" + link_name; }
std::string road_port(const std::string& link_name) { return "r" + link_name; }

TestbedLink plan_link(const LinkSpec& spec, std::size_t position) {
  const std::string network = "10.77." + std::to_string(position + 1) + ".";
  return {spec.name, spec.profile.name, "if" + spec.name, network + "1", network + "2"};
}

void wire(const std::vector<TestbedLink>& links, const Namespaces& namespaces) {
  const Socket socket = open_socket();
  for (std::size_t i = 0; i < links.size(); ++i) {
    const TestbedLink& link = links[i];
    make_pair(socket.get(), vehicle_port(link.name), link.nic, mac_of(i, Side::kVehicle),
              namespaces.vehicle.get());
    make_pair(socket.get(), road_port(link.name), link.nic, mac_of(i, Side::kRoad),
              namespaces.road.get());
    set_up(socket.get(), vehicle_port(link.name));
    set_up(socket.get(), road_port(link.name));
  }
  const int home = namespaces.middle.get();
  {
    const NetworkNamespaceScope scope(namespaces.vehicle.get(), home);
    configure_side(links, Side::kVehicle);
  }
  {
    const NetworkNamespaceScope scope(namespaces.road.get(), home);
    configure_side(links, Side::kRoad);
  }
  {
    const NetworkNamespaceScope scope(namespaces.vehicle.get(), home);
    await_operational(links);
  }
  const NetworkNamespaceScope scope(namespaces.road.get(), home);
  await_operational(links);
}

}  // namespace interneuron::netns
