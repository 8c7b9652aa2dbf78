#include "node/monitor/netlink_message.h"

#include <linux/if_addr.h>
#include <linux/neighbour.h>
#include <linux/rtnetlink.h>
#include <netinet/in.h>

#include <algorithm>

#include "node/io/address.h"

namespace interneuron::io::netlink {

namespace {

using RouteAttributes = std::array<nlattr*, RTA_MAX + 1>;

// The gateway that these attributes name, empty when there is none; nothing when it is of no
// family.
std::optional<interneuron::Address> gateway_of(const RouteAttributes& attributes, int card) {
  std::span<const std::byte> host;
  if (attributes[RTA_GATEWAY] != nullptr) {
    host = bytes_of(attributes[RTA_GATEWAY]);
  } else if (attributes[RTA_VIA] != nullptr) {
    // A gateway of another family (RFC 8950): struct rtvia, a family before the address.
    const auto bytes = bytes_of(attributes[RTA_VIA]);
    host = bytes.subspan(std::min(sizeof(rtvia), bytes.size()));
  } else {
    return interneuron::Address{};
  }
  const interneuron::Address out = address_of(host, card);
  return out.size > 0 ? std::optional(out) : std::nullopt;
}

// The hops of a route of several: each is a header, attributes and padding. All of them, or none.
std::vector<RouteHop> several_hops(std::span<const std::byte> bytes) {
  std::vector<RouteHop> out;
  while (!bytes.empty()) {
    rtnexthop header{};
    if (bytes.size() < sizeof header) return {};
    std::memcpy(&header, bytes.data(), sizeof header);
    const auto padded = static_cast<std::size_t>(RTNH_ALIGN(header.rtnh_len));
    if (header.rtnh_len < sizeof header || padded > bytes.size()) return {};
    const auto rest = bytes.subspan(sizeof header, header.rtnh_len - sizeof header);
    RouteAttributes attributes{};
    auto* first = const_cast<nlattr*>(reinterpret_cast<const nlattr*>(rest.data()));
    if (nla_parse(attributes.data(), RTA_MAX, first, static_cast<int>(rest.size()), nullptr) < 0) {
      return {};
    }
    const auto gateway = gateway_of(attributes, header.rtnh_ifindex);
    if (!gateway) return {};
    out.push_back({header.rtnh_ifindex, header.rtnh_flags, *gateway});
    bytes = bytes.subspan(padded);
  }
  return out;
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

std::span<const std::byte> host_bytes(const interneuron::Address& address) {
  if (family_of(address) == AF_INET) {
    return std::span(address.raw).subspan(offsetof(sockaddr_in, sin_addr), sizeof(in_addr));
  }
  return std::span(address.raw).subspan(offsetof(sockaddr_in6, sin6_addr), sizeof(in6_addr));
}

int put(nl_msg* message, int type, const interneuron::Address& address) {
  const auto bytes = host_bytes(address);
  return nla_put(message, type, static_cast<int>(bytes.size()), bytes.data());
}

std::optional<RouteAnswer> route_answer(const nlmsghdr& message, int index) {
  const auto attributes = attributes_of<rtmsg, RTA_MAX>(message);
  if (message.nlmsg_type != RTM_NEWROUTE || !attributes) return std::nullopt;
  const auto* route = header_of<rtmsg>(message);
  if (route->rtm_type != RTN_UNICAST && route->rtm_type != RTN_LOCAL) return std::nullopt;
  if (number_of<std::uint32_t>((*attributes)[RTA_OIF]) != static_cast<std::uint32_t>(index)) {
    return std::nullopt;
  }
  const auto gateway = gateway_of(*attributes, index);
  if (!gateway) return std::nullopt;
  RouteAnswer out;
  out.gateway = *gateway;
  out.source = address_of(bytes_of((*attributes)[RTA_PREFSRC]), index);
  return out;
}

std::vector<RouteHop> hops_of(const nlmsghdr& message) {
  const auto attributes = attributes_of<rtmsg, RTA_MAX>(message);
  if (message.nlmsg_type != RTM_NEWROUTE || !attributes) return {};
  if ((*attributes)[RTA_MULTIPATH] != nullptr) {
    return several_hops(bytes_of((*attributes)[RTA_MULTIPATH]));
  }
  const auto card = number_of<std::int32_t>((*attributes)[RTA_OIF]);
  const auto gateway = gateway_of(*attributes, card.value_or(0));
  if (!card || !gateway) return {};
  // The lowest byte of the flags of a route with one hop is that hop's.
  return {{*card, header_of<rtmsg>(message)->rtm_flags & 0xffU, *gateway}};
}

bool leads_through(const nlmsghdr& message, int index) {
  const auto hops = hops_of(message);
  if (hops.empty()) return false;
  const unsigned type = header_of<rtmsg>(message)->rtm_type;
  return (type == RTN_UNICAST || type == RTN_LOCAL) &&
         std::ranges::find(hops, index, &RouteHop::card) != hops.end();
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
