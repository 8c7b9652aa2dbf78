#include "node/monitor/nic_table.h"

#include <linux/if.h>
#include <linux/if_addr.h>
#include <linux/if_arp.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <netlink/attr.h>

#include <algorithm>
#include <array>
#include <utility>

#include "node/io/address.h"
#include "node/io/nic_kind.h"
#include "node/monitor/netlink_message.h"

namespace interneuron::io {

namespace {

// Names of the states of RFC 2863, indexed by the kernel's numbers (IF_OPER_UNKNOWN …, linux/if.h).
constexpr std::array kOperstates{"unknown", "notpresent", "down", "lowerlayerdown",
                                 "testing", "dormant",    "up"};

// The kind of a NIC made of software: "veth", "bridge", …; empty for hardware.
std::string virtual_kind(nlattr* link_info) {
  std::array<nlattr*, IFLA_INFO_MAX + 1> info{};
  if (link_info == nullptr ||
      nla_parse_nested(info.data(), IFLA_INFO_MAX, link_info, nullptr) < 0) {
    return {};
  }
  return netlink::text_of(info[IFLA_INFO_KIND]);
}

// Empty when the attribute is none of this family.
Address address_in(int family, const nlattr* attribute, int index) {
  const Address out = netlink::address_of(netlink::bytes_of(attribute), index);
  return out.size > 0 && family_of(out) == family ? out : Address{};
}

// Adds an address: IPv4 before IPv6, otherwise at the end.
void insert(std::vector<Address>& into, const Address& address) {
  if (address.size == 0 || std::ranges::find(into, address) != into.end()) return;
  const auto place = is_ipv6(address) ? into.end() : std::ranges::find_if(into, is_ipv6);
  into.insert(place, address);
}

}  // namespace

void NicTable::read(nl_sock* requests, bool default_routes) {
  nics_.clear();
  default_routes_.clear();
  const auto take = [this](const nlmsghdr& message) { apply(message); };
  netlink::check(netlink::list(requests, RTM_GETLINK, take), "list the network cards");
  netlink::check(netlink::list(requests, RTM_GETADDR, take), "list the addresses");
  if (!default_routes) return;
  netlink::check(netlink::list(requests, RTM_GETROUTE,
                               [this](const nlmsghdr& message) { apply_default_route(message); }),
                 "list the routes");
}

bool NicTable::read_default_routes(nl_sock* requests) {
  default_routes_.clear();
  for (Nic& nic : nics_) nic.gateways.clear();
  return netlink::list(requests, RTM_GETROUTE,
                       [this](const nlmsghdr& message) { apply_default_route(message); }) >= 0;
}

void NicTable::refresh_lagging(nl_sock* requests) {
  std::vector<int> lagging;
  for (const Nic& nic : nics_) {
    if (nic.admin_up && nic.carrier != nic.up) lagging.push_back(nic.index);
  }
  for (const int index : lagging) {
    const netlink::Message request(nlmsg_alloc_simple(RTM_GETLINK, NLM_F_REQUEST));
    ifinfomsg header{};
    header.ifi_index = index;
    if (!request || nlmsg_append(request.get(), &header, sizeof header, NLMSG_ALIGNTO) < 0) return;
    netlink::ask(requests, request.get(), [this](const nlmsghdr& message) { apply(message); });
  }
}

void NicTable::apply(const nlmsghdr& message) {
  switch (message.nlmsg_type) {
    case RTM_NEWLINK:
      return apply_link(message);
    case RTM_DELLINK:
      return remove_link(message);
    case RTM_NEWADDR:
    case RTM_DELADDR:
      return apply_address(message);
    default:
      return;
  }
}

Nic* NicTable::entry(int index) {
  const auto it = std::ranges::find(nics_, index, &Nic::index);
  return it == nics_.end() ? nullptr : &*it;
}

const Nic* NicTable::find(int index) const { return const_cast<NicTable*>(this)->entry(index); }

const Nic* NicTable::find(std::string_view name) const {
  const auto it = std::ranges::find(nics_, name, &Nic::name);
  return it == nics_.end() ? nullptr : &*it;
}

void NicTable::apply_link(const nlmsghdr& message) {
  const auto found = netlink::attributes_of<ifinfomsg, IFLA_MAX>(message);
  if (!found) return;
  const auto& attributes = *found;
  const auto* header = netlink::header_of<ifinfomsg>(message);
  const std::string name = netlink::text_of(attributes[IFLA_IFNAME]);
  const auto mtu = netlink::number_of<std::uint32_t>(attributes[IFLA_MTU]);
  // Bridges tell of their ports, and wireless drivers of scans, in messages of the same type that
  // do not describe the NIC.
  if (header->ifi_family != AF_UNSPEC || name.empty() || !mtu) return;
  Nic* nic = entry(header->ifi_index);
  if (nic == nullptr) {
    const auto place =
        std::ranges::upper_bound(nics_, header->ifi_index, std::less<>{}, &Nic::index);
    nic = &*nics_.insert(place, Nic{});
    nic->index = header->ifi_index;
  }
  const std::string mac = mac_text(netlink::bytes_of(attributes[IFLA_ADDRESS]));
  const bool renamed = std::exchange(nic->name, name) != name;
  const bool another_mac = std::exchange(nic->mac, mac) != mac;
  if (renamed || another_mac) {
    const NicOrigin origin = origin_of(*nic, header->ifi_type == ARPHRD_LOOPBACK,
                                       virtual_kind(attributes[IFLA_LINKINFO]));
    nic->kind = origin.kind;
    nic->driver = origin.driver;
  }
  nic->mtu = *mtu;
  if (const auto queues = netlink::number_of<std::uint32_t>(attributes[IFLA_NUM_RX_QUEUES])) {
    nic->receive_queues = std::max(1U, *queues);
  }
  nic->admin_up = (header->ifi_flags & IFF_UP) != 0;
  nic->up = nic->admin_up && (header->ifi_flags & IFF_RUNNING) != 0;
  const auto carrier = netlink::number_of<std::uint8_t>(attributes[IFLA_CARRIER]);
  nic->carrier = carrier ? *carrier != 0 : nic->up;
  const std::size_t operstate =
      netlink::number_of<std::uint8_t>(attributes[IFLA_OPERSTATE]).value_or(0);
  nic->operstate = kOperstates[operstate < kOperstates.size() ? operstate : 0];
}

void NicTable::remove_link(const nlmsghdr& message) {
  const auto* header = netlink::header_of<ifinfomsg>(message);
  if (header == nullptr || header->ifi_family != AF_UNSPEC) return;
  const auto attributes = netlink::attributes_of<ifinfomsg, IFLA_MAX>(message);
  const bool moved = attributes && (*attributes)[IFLA_NEW_NETNSID] != nullptr;
  departures_[header->ifi_index] = moved ? "moved to another network namespace" : "unplugged";
  std::erase_if(nics_, [&](const Nic& nic) { return nic.index == header->ifi_index; });
  std::erase_if(default_routes_,
                [&](const DefaultRoute& route) { return route.index == header->ifi_index; });
}

void NicTable::apply_address(const nlmsghdr& message) {
  const auto found = netlink::attributes_of<ifaddrmsg, IFA_MAX>(message);
  if (!found) return;
  const auto& attributes = *found;
  const auto* header = netlink::header_of<ifaddrmsg>(message);
  const int index = static_cast<int>(header->ifa_index);
  Nic* nic = entry(index);
  if (nic == nullptr) return;
  // On a point-to-point NIC IFA_ADDRESS is the other end.
  const nlattr* local =
      attributes[IFA_LOCAL] != nullptr ? attributes[IFA_LOCAL] : attributes[IFA_ADDRESS];
  const Address address = address_in(header->ifa_family, local, index);
  const std::uint32_t flags =
      netlink::number_of<std::uint32_t>(attributes[IFA_FLAGS]).value_or(header->ifa_flags);
  // An IPv6 address may not be used before duplicate address detection is done (RFC 4862 §5.4),
  // unless it is optimistic (RFC 4429).
  const bool pending = (flags & IFA_F_TENTATIVE) != 0 && (flags & IFA_F_OPTIMISTIC) == 0;
  const bool usable =
      message.nlmsg_type == RTM_NEWADDR && !pending && (flags & IFA_F_DADFAILED) == 0;
  if (usable) {
    insert(nic->addresses, address);
  } else {
    std::erase(nic->addresses, address);
  }
}

void NicTable::apply_default_route(const nlmsghdr& message) {
  const auto* header = netlink::header_of<rtmsg>(message);
  if (header == nullptr || message.nlmsg_type != RTM_NEWROUTE || header->rtm_dst_len != 0 ||
      header->rtm_type != RTN_UNICAST || (header->rtm_flags & RTM_F_CLONED) != 0 ||
      (header->rtm_family != AF_INET && header->rtm_family != AF_INET6)) {
    return;
  }
  for (const netlink::RouteHop& hop : netlink::hops_of(message)) {
    Nic* nic = entry(hop.card);
    if (nic == nullptr || (hop.flags & RTNH_F_DEAD) != 0) continue;
    default_routes_.push_back({hop.card, header->rtm_family == AF_INET6});
    insert(nic->gateways, hop.gateway);
  }
}

bool NicTable::has_default_route(int index, bool ipv6) const {
  return std::ranges::find(default_routes_, DefaultRoute{index, ipv6}) != default_routes_.end();
}

std::string_view NicTable::departure(int index) const {
  const auto it = departures_.find(index);
  return it == departures_.end() ? std::string_view("unplugged") : std::string_view(it->second);
}

}  // namespace interneuron::io
