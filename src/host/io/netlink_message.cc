#include "host/io/netlink_message.h"

#include <linux/if_addr.h>
#include <linux/neighbour.h>
#include <linux/rtnetlink.h>
#include <netinet/in.h>
#include <netlink/route/nexthop.h>

#include <algorithm>

#include "host/io/address.h"

namespace interneuron::io::netlink {

namespace {

// Whether each hop of a route of several holds at least its header and, with the padding behind it,
// no more than is there: libnl counts the padding without a look at what is left.
bool adds_up(std::span<const std::byte> hops) {
  while (!hops.empty()) {
    rtnexthop hop{};
    if (hops.size() < sizeof hop) return false;
    std::memcpy(&hop, hops.data(), sizeof hop);
    const auto padded = static_cast<std::size_t>(RTNH_ALIGN(hop.rtnh_len));
    if (hop.rtnh_len < sizeof hop || padded > hops.size()) return false;
    hops = hops.subspan(padded);
  }
  return true;
}

}  // namespace

std::span<const std::byte> bytes_of(const nlattr* attribute) {
  if (attribute == nullptr) return {};
  return {static_cast<const std::byte*>(nla_data(attribute)),
          static_cast<std::size_t>(std::max(nla_len(attribute), 0))};
}

std::string text_of(const nlattr* attribute) {
  const auto bytes = bytes_of(attribute);
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  return bytes.empty() ? std::string() : std::string(text, ::strnlen(text, bytes.size()));
}

interneuron::Address address_of(std::span<const std::byte> host, int index) {
  if (host.size() == sizeof(in_addr)) {
    sockaddr_in name{};
    name.sin_family = AF_INET;
    std::memcpy(&name.sin_addr, host.data(), host.size());
    return from_sockaddr(reinterpret_cast<const sockaddr*>(&name), sizeof name);
  }
  if (host.size() != sizeof(in6_addr)) return {};
  sockaddr_in6 name{};
  name.sin6_family = AF_INET6;
  std::memcpy(&name.sin6_addr, host.data(), host.size());
  if (IN6_IS_ADDR_LINKLOCAL(&name.sin6_addr)) {
    name.sin6_scope_id = static_cast<std::uint32_t>(index);
  }
  return from_sockaddr(reinterpret_cast<const sockaddr*>(&name), sizeof name);
}

std::optional<RouteAnswer> route_answer(const nlmsghdr& message, int index) {
  const auto attributes = attributes_of<rtmsg, RTA_MAX>(message);
  if (message.nlmsg_type != RTM_NEWROUTE || !attributes) return std::nullopt;
  const auto* route = header_of<rtmsg>(message);
  if (route->rtm_type != RTN_UNICAST && route->rtm_type != RTN_LOCAL) return std::nullopt;
  if (number_of<std::uint32_t>((*attributes)[RTA_OIF]) != static_cast<std::uint32_t>(index)) {
    return std::nullopt;
  }
  RouteAnswer out;
  if (const nlattr* gateway = (*attributes)[RTA_GATEWAY]) {
    out.gateway = address_of(bytes_of(gateway), index);
    if (out.gateway.size == 0) return std::nullopt;
  } else if (const nlattr* via = (*attributes)[RTA_VIA]) {
    // A gateway of another family (RFC 8950): struct rtvia, a family before the address.
    const auto bytes = bytes_of(via);
    out.gateway = address_of(bytes.subspan(std::min(sizeof(rtvia), bytes.size())), index);
    if (out.gateway.size == 0) return std::nullopt;
  }
  out.source = address_of(bytes_of((*attributes)[RTA_PREFSRC]), index);
  return out;
}

Route parse_route(const nlmsghdr& message) {
  const auto attributes = attributes_of<rtmsg, RTA_MAX>(message);
  rtnl_route* parsed = nullptr;
  if (message.nlmsg_type != RTM_NEWROUTE || !attributes ||
      !adds_up(bytes_of((*attributes)[RTA_MULTIPATH])) ||
      rtnl_route_parse(const_cast<nlmsghdr*>(&message), &parsed) < 0) {
    return nullptr;
  }
  return Route(parsed);
}

bool leads_through(const nlmsghdr& message, int index) {
  const Route route = parse_route(message);
  if (!route) return false;
  const int type = rtnl_route_get_type(route.get());
  if (type != RTN_UNICAST && type != RTN_LOCAL) return false;
  for (int i = 0; i < rtnl_route_get_nnexthops(route.get()); ++i) {
    if (rtnl_route_nh_get_ifindex(rtnl_route_nexthop_n(route.get(), i)) == index) return true;
  }
  return false;
}

bool is_default_route(const nlmsghdr& message) {
  const auto* header = header_of<rtmsg>(message);
  return header != nullptr && header->rtm_dst_len == 0;
}

std::optional<Neighbour> neighbour(const nlmsghdr& message) {
  if (message.nlmsg_type != RTM_NEWNEIGH && message.nlmsg_type != RTM_DELNEIGH) {
    return std::nullopt;
  }
  const auto attributes = attributes_of<ndmsg, NDA_MAX>(message);
  if (!attributes || bytes_of((*attributes)[NDA_DST]).empty()) return std::nullopt;
  const auto* header = header_of<ndmsg>(message);
  Neighbour out{header->ndm_ifindex, header->ndm_state, bytes_of((*attributes)[NDA_DST])};
  const auto mac = bytes_of((*attributes)[NDA_LLADDR]);
  if (mac.size() == Mac{}.size()) std::ranges::copy(mac, out.mac.emplace().begin());
  return out;
}

std::optional<int> card_of(const nlmsghdr& message) {
  switch (message.nlmsg_type) {
    case RTM_NEWLINK:
    case RTM_DELLINK: {
      const auto* header = header_of<ifinfomsg>(message);
      if (header == nullptr || header->ifi_family != AF_UNSPEC) return std::nullopt;
      return header->ifi_index;
    }
    case RTM_NEWADDR:
    case RTM_DELADDR: {
      const auto* header = header_of<ifaddrmsg>(message);
      if (header == nullptr) return std::nullopt;
      return static_cast<int>(header->ifa_index);
    }
    default:
      return std::nullopt;
  }
}

}  // namespace interneuron::io::netlink
