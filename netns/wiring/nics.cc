#include "netns/wiring/nics.h"

#include <linux/ethtool.h>
#include <linux/if.h>
#include <linux/if_addr.h>
#include <linux/if_link.h>
#include <linux/ip.h>
#include <linux/neighbour.h>
#include <linux/rtnetlink.h>
#include <linux/sockios.h>
#include <netlink/route/addr.h>
#include <netlink/route/link/inet.h>
#include <netlink/route/link/inet6.h>
#include <netlink/route/link/veth.h>
#include <netlink/route/neighbour.h>
#include <netlink/route/nexthop.h>
#include <netlink/route/route.h>
#include <netlink/route/rule.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "netns/state/check.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

namespace {

using netlink::Address;
using netlink::check_nl;
using netlink::Deleter;
using netlink::family_of;
using netlink::Link;
using netlink::parse_address;
using netlink::require;

using Veth = std::unique_ptr<rtnl_link, Deleter<rtnl_link_veth_release>>;
using NicAddress = std::unique_ptr<rtnl_addr, Deleter<rtnl_addr_put>>;
using Neighbour = std::unique_ptr<rtnl_neigh, Deleter<rtnl_neigh_put>>;
using Route = std::unique_ptr<rtnl_route, Deleter<rtnl_route_put>>;
using Rule = std::unique_ptr<rtnl_rule, Deleter<rtnl_rule_put>>;

// Ethernet's, in bytes.
constexpr unsigned kMtu = 1500;
// await_operational() gives up after this. The kernel may report carriers only once a second.
constexpr int kOperationalBoundMs = 5000;

void describe(rtnl_link* link, const NicEnd& end) {
  rtnl_link_set_name(link, end.nic.c_str());
  rtnl_link_set_mtu(link, kMtu);
  if (end.index != 0) rtnl_link_set_ifindex(link, end.index);
  rtnl_link_set_ns_fd(link, end.network_namespace);
  if (!end.mac.empty()) rtnl_link_set_addr(link, parse_address(end.mac, AF_LLC).get());
  // Neighbours are permanent entries, so no ARP is needed. NOARP also turns off IPv6's duplicate
  // address detection and the multicast groups of its addresses, which the kernel would report.
  rtnl_link_set_flags(link, IFF_NOARP);
  // On a NIC with multicast a router would join the group of all routers and report that.
  if (!end.multicast) rtnl_link_unset_flags(link, IFF_MULTICAST);
}

void add_address(nl_sock* socket, const std::string& address, const std::string& nic, int index) {
  const NicAddress entry = require(NicAddress(rtnl_addr_alloc()));
  const Address local = parse_address(address, family_of(address));
  rtnl_addr_set_ifindex(entry.get(), index);
  check_nl(rtnl_addr_set_local(entry.get(), local.get()), "use the address " + address);
  if (family_of(address) == AF_INET6) rtnl_addr_set_flags(entry.get(), IFA_F_NODAD);
  check_nl(rtnl_addr_add(socket, entry.get(), NLM_F_REPLACE),
           "give " + nic + " the address " + address);
}

void add_neighbour(nl_sock* socket, const NeighbourPlan& plan, const std::string& nic, int index) {
  const Neighbour entry = require(Neighbour(rtnl_neigh_alloc()));
  const Address destination = parse_address(plan.address, family_of(plan.address));
  const Address hardware = parse_address(plan.mac, AF_LLC);
  rtnl_neigh_set_ifindex(entry.get(), index);
  check_nl(rtnl_neigh_set_dst(entry.get(), destination.get()), "use the neighbour " + plan.address);
  rtnl_neigh_set_lladdr(entry.get(), hardware.get());
  rtnl_neigh_set_state(entry.get(), NUD_PERMANENT);
  check_nl(rtnl_neigh_add(socket, entry.get(), NLM_F_CREATE | NLM_F_REPLACE),
           "add the neighbour " + plan.address + " of " + nic);
}

void add_route(nl_sock* socket, const RoutePlan& plan, const std::string& nic, int index) {
  const int family = family_of(plan.destination);
  const Route route = require(Route(rtnl_route_alloc()));
  rtnl_route_set_family(route.get(), static_cast<std::uint8_t>(family));
  rtnl_route_set_table(route.get(), plan.table);
  rtnl_route_set_priority(route.get(), plan.metric);
  rtnl_route_set_protocol(route.get(), RTPROT_STATIC);
  rtnl_route_set_scope(route.get(), plan.gateway.empty() ? RT_SCOPE_LINK : RT_SCOPE_UNIVERSE);
  check_nl(rtnl_route_set_dst(route.get(), parse_address(plan.destination, family).get()),
           "use the route to " + plan.destination);
  if (!plan.source.empty()) {
    rtnl_route_set_pref_src(route.get(), parse_address(plan.source, family).get());
  }
  rtnl_nexthop* hop = rtnl_route_nh_alloc();
  if (hop == nullptr) check_nl(-NLE_NOMEM, "make a route");
  rtnl_route_nh_set_ifindex(hop, index);
  if (!plan.gateway.empty()) {
    rtnl_route_nh_set_gateway(hop, parse_address(plan.gateway, family).get());
  }
  // The route owns the hop from here on.
  rtnl_route_add_nexthop(route.get(), hop);
  check_nl(rtnl_route_add(socket, route.get(), NLM_F_REPLACE),
           "route " + plan.destination + " through " + nic);
}

void add_rule(nl_sock* socket, const RulePlan& plan) {
  const int family = family_of(plan.source);
  const Rule rule = require(Rule(rtnl_rule_alloc()));
  const Address source = parse_address(plan.source, family);
  rtnl_rule_set_family(rule.get(), family);
  check_nl(rtnl_rule_set_src(rule.get(), source.get()), "use the rule for " + plan.source);
  rtnl_rule_set_table(rule.get(), plan.table);
  rtnl_rule_set_prio(rule.get(), plan.table);
  rtnl_rule_set_action(rule.get(), FR_ACT_TO_TBL);
  const int result = rtnl_rule_add(socket, rule.get(), NLM_F_EXCL);
  if (result != -NLE_EXIST) check_nl(result, "add the routing rule for " + plan.source);
}

// Whether the kernel has IPv6 at all, also when the testbed does not use it.
bool kernel_has_ipv6() { return ::access("/proc/sys/net/ipv6/conf", F_OK) == 0; }

// Keeps the kernel from sending packets of its own at this NIC. Done by netlink, as /proc/sys is
// read-only in containers.
void forbid_own_packets(nl_sock* socket, const std::string& nic, int index, bool forwards) {
  const Link link = require(Link(rtnl_link_alloc()));
  rtnl_link_set_ifindex(link.get(), index);
  const Link change = require(Link(rtnl_link_alloc()));
  check_nl(rtnl_link_inet_set_conf(change.get(), IPV4_DEVCONF_FORWARDING, forwards ? 1 : 0),
           "set forwarding of " + nic);
  if (kernel_has_ipv6()) {
    check_nl(rtnl_link_inet6_set_addr_gen_mode(change.get(), IN6_ADDR_GEN_MODE_NONE),
             "forbid link-local addresses on " + nic);
  }
  check_nl(rtnl_link_change(socket, link.get(), change.get(), 0), "configure " + nic);
}

// Whether all NICs are operational; else `culprit` is one that is not. Asks for each NIC by name,
// because that makes kernels from 6.8 on process its carrier first, unlike listing all NICs. By
// itself the kernel processes a hundred NICs at a time, once a second.
bool operational(nl_sock* socket, const std::vector<NicPlan>& plans, std::string& culprit) {
  for (const NicPlan& plan : plans) {
    if (rtnl_link_get_operstate(netlink::find_link(socket, plan.nic).get()) == IF_OPER_UP) continue;
    culprit = plan.nic;
    return false;
  }
  return true;
}

// Whether the kernel delivers packets to this own address locally, which it does once the address
// is complete.
bool is_local(nl_sock* socket, const std::string& address) {
  rtnl_route* found = nullptr;
  const Address destination = parse_address(address.substr(0, address.find('/')), AF_INET6);
  if (rtnl_route_lookup(socket, destination.get(), &found) < 0) return false;
  const Route route(found);
  return rtnl_route_get_type(found) == RTN_LOCAL;
}

// Whether all IPv6 addresses are complete; else `culprit` is one that is not.
bool reachable(nl_sock* socket, const std::vector<NicPlan>& plans, std::string& culprit) {
  for (const NicPlan& plan : plans) {
    for (const std::string& address : plan.addresses) {
      if (family_of(address) != AF_INET6 || is_local(socket, address)) continue;
      culprit = address + " of " + plan.nic;
      return false;
    }
  }
  return true;
}

// Memory for a structure of ethtool that ends in an array of a length known at run time; zeroed and
// aligned for its widest member.
template <class Header>
class EthtoolBuffer {
 public:
  explicit EthtoolBuffer(std::size_t tail_bytes)
      : words_((sizeof(Header) + tail_bytes + sizeof(std::uint64_t) - 1) / sizeof(std::uint64_t)) {}
  Header* get() { return reinterpret_cast<Header*>(words_.data()); }

 private:
  std::vector<std::uint64_t> words_;
};

// The ethtool ioctl of one NIC of the current network namespace. Errors: TestbedError.
class Ethtool {
 public:
  explicit Ethtool(const std::string& nic)
      : nic_(nic),
        socket_(check(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), "open a socket")) {}

  // `command` is a structure that begins with the number of the command; the answer is in it.
  void call(void* command) const {
    ifreq request{};
    nic_.copy(request.ifr_name, IFNAMSIZ - 1);
    request.ifr_data = static_cast<char*>(command);
    check(::ioctl(socket_.get(), SIOCETHTOOL, &request), "set the offloads of " + nic_);
  }

  // The names of all features that the kernel knows, in the order of their bits.
  std::vector<std::string> feature_names() const {
    EthtoolBuffer<ethtool_sset_info> info(sizeof(std::uint32_t));
    info.get()->cmd = ETHTOOL_GSSET_INFO;
    info.get()->sset_mask = std::uint64_t{1} << ETH_SS_FEATURES;
    call(info.get());
    const std::size_t count = info.get()->data[0];

    EthtoolBuffer<ethtool_gstrings> strings(count * ETH_GSTRING_LEN);
    strings.get()->cmd = ETHTOOL_GSTRINGS;
    strings.get()->string_set = ETH_SS_FEATURES;
    strings.get()->len = static_cast<std::uint32_t>(count);
    call(strings.get());
    std::vector<std::string> names;
    for (std::size_t i = 0; i < count; ++i) {
      const char* name = reinterpret_cast<const char*>(strings.get()->data) + i * ETH_GSTRING_LEN;
      names.emplace_back(name, ::strnlen(name, ETH_GSTRING_LEN));
    }
    return names;
  }

 private:
  std::string nic_;
  io::FileDescriptor socket_;
};

bool is_segmentation(std::string_view feature) {
  return feature.find("segmentation") != std::string_view::npos ||
         feature.substr(0, 7) == "tx-gso-" || feature == "rx-gro" || feature == "rx-gro-list" ||
         feature == "rx-udp-gro-forwarding";
}

// Turns off every segmentation offload (TSO, GSO, USO) and GRO of a NIC of the current network
// namespace, so that the emulator sees single packets, as they would be on the air. Checksum
// offload stays on, because without it kernels before 6.11 refuse UDP_SEGMENT with EIO
// (udp_send_skb); the emulator computes the checksums.
void disable_segmentation_offloads(const std::string& nic) {
  const Ethtool ethtool(nic);
  const std::vector<std::string> names = ethtool.feature_names();
  const std::size_t blocks = (names.size() + 31) / 32;

  EthtoolBuffer<ethtool_gfeatures> present(blocks * sizeof(ethtool_get_features_block));
  present.get()->cmd = ETHTOOL_GFEATURES;
  present.get()->size = static_cast<std::uint32_t>(blocks);
  ethtool.call(present.get());

  EthtoolBuffer<ethtool_sfeatures> wanted(blocks * sizeof(ethtool_set_features_block));
  wanted.get()->cmd = ETHTOOL_SFEATURES;
  wanted.get()->size = static_cast<std::uint32_t>(blocks);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::uint32_t bit = std::uint32_t{1} << (i % 32);
    // Asking for one feature that the driver cannot change would make the whole call fail.
    const bool changeable = (present.get()->features[i / 32].available & bit) != 0;
    if (changeable && is_segmentation(names[i])) wanted.get()->features[i / 32].valid |= bit;
  }
  ethtool.call(wanted.get());

  ethtool.call(present.get());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::uint32_t bit = std::uint32_t{1} << (i % 32);
    if ((wanted.get()->features[i / 32].valid & present.get()->features[i / 32].active & bit) !=
        0) {
      throw TestbedError(1, "cannot turn " + names[i] + " of " + nic + " off");
    }
  }
}

}  // namespace

void make_pair(nl_sock* socket, const NicEnd& a, const NicEnd& b) {
  const Veth veth = require(Veth(rtnl_link_veth_alloc()));
  // The peer belongs to the pair. libnl counts a reference for this second owner, which gives it
  // back.
  const Link peer(rtnl_link_veth_get_peer(veth.get()));
  describe(veth.get(), a);
  describe(peer.get(), b);
  const int result = rtnl_link_add(socket, veth.get(), NLM_F_CREATE | NLM_F_EXCL);
  if (result == -NLE_OPNOTSUPP) {
    throw TestbedError(1, "cannot make the veth pair " + a.nic +
                              ": the kernel has no veth; `modprobe veth` as root loads it");
  }
  check_nl(result, "make the veth pair " + a.nic);
}

void set_up(nl_sock* socket, const std::string& nic, bool forwards) {
  const int index = netlink::nic_index(nic);
  forbid_own_packets(socket, nic, index, forwards);
  const Link link = require(Link(rtnl_link_alloc()));
  rtnl_link_set_ifindex(link.get(), index);
  const Link change = require(Link(rtnl_link_alloc()));
  rtnl_link_set_flags(change.get(), IFF_UP);
  check_nl(rtnl_link_change(socket, link.get(), change.get(), 0), "set " + nic + " up");
}

void set_up(nl_sock* socket, const NicPlan& plan) {
  disable_segmentation_offloads(plan.nic);
  set_up(socket, plan.nic, plan.forwards);
  configure(socket, plan, netlink::nic_index(plan.nic));
}

void configure(nl_sock* socket, const NicPlan& plan, int index) {
  for (const auto& address : plan.addresses) add_address(socket, address, plan.nic, index);
  for (const auto& neighbour : plan.neighbours) add_neighbour(socket, neighbour, plan.nic, index);
  for (const auto& route : plan.routes) add_route(socket, route, plan.nic, index);
  for (const auto& rule : plan.rules) add_rule(socket, rule);
}

void await_operational(nl_sock* socket, const std::vector<NicPlan>& plans) {
  std::string culprit;
  int waited_ms = 0;
  // Each look makes the kernel process the carriers (see operational()), so it looks every
  // millisecond; nothing else hurries the kernel.
  while (!operational(socket, plans, culprit) || !reachable(socket, plans, culprit)) {
    if (++waited_ms > kOperationalBoundMs) {
      throw TestbedError(1, culprit + " is not operational after 5 s");
    }
    ::poll(nullptr, 0, 1);
  }
}

}  // namespace interneuron::netns
