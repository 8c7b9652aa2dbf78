#include "host/io/next_hops.h"

#include <linux/neighbour.h>
#include <linux/rtnetlink.h>
#include <netlink/attr.h>
#include <netlink/errno.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>
#include <span>

#include "host/io/address.h"
#include "host/io/nic_table.h"
#include "interneuron/transport.h"

namespace interneuron::io {

namespace {

// For the events of a burst of changes.
constexpr std::size_t kEventBufferBytes = 256 * 1024;
// RFC 863.
constexpr std::uint16_t kDiscardPort = 9;
// States of a neighbour whose hardware address can be used (NUD_VALID of Linux).
constexpr unsigned kValid =
    NUD_PERMANENT | NUD_NOARP | NUD_REACHABLE | NUD_PROBE | NUD_STALE | NUD_DELAY;

std::span<const std::byte> host_bytes(const Address& address) {
  if (family_of(address) == AF_INET) {
    return std::span(address.raw).subspan(offsetof(sockaddr_in, sin_addr), sizeof(in_addr));
  }
  return std::span(address.raw).subspan(offsetof(sockaddr_in6, sin6_addr), sizeof(in6_addr));
}

// From the bare bytes, which come from the kernel; empty when they are of no family.
Address address_of(std::span<const std::byte> host, int index) {
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

std::span<const std::byte> bytes_of(const nlattr* attribute) {
  return {static_cast<const std::byte*>(nla_data(attribute)),
          static_cast<std::size_t>(std::max(nla_len(attribute), 0))};
}

int put(nl_msg* message, int type, const Address& address) {
  const auto bytes = host_bytes(address);
  return nla_put(message, type, static_cast<int>(bytes.size()), bytes.data());
}

template <class Header, std::size_t Most>
bool parse(const nlmsghdr& message, std::array<nlattr*, Most>& attributes) {
  return nlmsg_parse(const_cast<nlmsghdr*>(&message), sizeof(Header), attributes.data(),
                     static_cast<int>(Most) - 1, nullptr) >= 0;
}

}  // namespace

NextHops::NextHops(int index, bool has_neighbours, int helper)
    : index_(index),
      has_neighbours_(has_neighbours),
      helper_(helper),
      requests_(netlink::open_socket()),
      events_(netlink::open_event_socket(
          {RTNLGRP_LINK, RTNLGRP_NEIGH, RTNLGRP_IPV4_IFADDR, RTNLGRP_IPV6_IFADDR,
           RTNLGRP_IPV4_ROUTE, RTNLGRP_IPV6_ROUTE, RTNLGRP_IPV4_RULE, RTNLGRP_IPV6_RULE},
          kEventBufferBytes)) {}

NextHops::Hop NextHops::find(const Address& to, const Address& source, TimePoint now) {
  if (to.size == 0) return {};
  Key key{};
  std::ranges::copy(host_bytes(to), key.first.begin());
  if (source.size > 0) std::ranges::copy(host_bytes(source), key.second.begin());
  auto it = entries_.find(key);
  if (it == entries_.end()) {
    if (entries_.size() >= kMost) entries_.clear();
    it = entries_.emplace(key, Entry{}).first;
  }
  Entry& entry = it->second;
  if (entry.stale || now - entry.looked_up >= kRefresh) look_up(to, source, now, entry);
  if (!entry.routed) return {};
  if (entry.resolved) return {State::kKnown, entry.source, entry.mac};
  const bool patient = entry.asked && now - *entry.asked < kPatience;
  // The answer is looked for with the next datagram.
  if (patient) next_look_ = now;
  return {patient ? State::kAsking : State::kUnreachable, entry.source, {}};
}

void NextHops::look_up(const Address& to, const Address& source, TimePoint now, Entry& entry) {
  entry.stale = false;
  entry.looked_up = now;
  entry.routed = read_route(to, source, entry);
  entry.resolved = entry.routed && !has_neighbours_;
  if (!entry.routed || !has_neighbours_) return;
  const unsigned state = read_neighbour(entry);
  entry.resolved = (state & kValid) != 0;
  // Somebody else has asked.
  if (state == NUD_INCOMPLETE && !entry.asked) entry.asked = now;
  // What is used is verified: the kernel leaves a neighbour stale until somebody uses it.
  const bool sure = (state & (NUD_PERMANENT | NUD_NOARP | NUD_REACHABLE | NUD_PROBE | NUD_DELAY |
                              NUD_INCOMPLETE)) != 0;
  if (sure || (entry.asked && now - *entry.asked < kRefresh)) return;
  entry.asked = now;
  ask_for(entry.neighbour);
  // A card that asks nobody has the answer at once.
  if (!entry.resolved) entry.resolved = (read_neighbour(entry) & kValid) != 0;
}

bool NextHops::read_route(const Address& to, const Address& source, Entry& entry) {
  const netlink::Message request(nlmsg_alloc_simple(RTM_GETROUTE, NLM_F_REQUEST));
  const auto bits = static_cast<unsigned char>(host_bytes(to).size() * 8);
  rtmsg header{};
  header.rtm_family = static_cast<unsigned char>(family_of(to));
  header.rtm_dst_len = bits;
  header.rtm_src_len = source.size > 0 ? bits : 0;
  if (!request || nlmsg_append(request.get(), &header, sizeof header, NLMSG_ALIGNTO) < 0 ||
      put(request.get(), RTA_DST, to) < 0 ||
      nla_put_u32(request.get(), RTA_OIF, static_cast<std::uint32_t>(index_)) < 0 ||
      (source.size > 0 && put(request.get(), RTA_SRC, source) < 0)) {
    return false;
  }
  bool routed = false;
  entry.source = source;
  entry.neighbour = to;
  const int result = netlink::ask(requests_.get(), request.get(), [&](const nlmsghdr& message) {
    std::array<nlattr*, RTA_MAX + 1> attributes{};
    if (message.nlmsg_type != RTM_NEWROUTE || !parse<rtmsg>(message, attributes)) return;
    const auto* route = static_cast<const rtmsg*>(NLMSG_DATA(&message));
    if (route->rtm_type != RTN_UNICAST && route->rtm_type != RTN_LOCAL) return;
    const nlattr* device = attributes[RTA_OIF];
    if (device == nullptr || nla_get_u32(device) != static_cast<std::uint32_t>(index_)) return;
    routed = true;
    if (const nlattr* gateway = attributes[RTA_GATEWAY]) {
      entry.neighbour = address_of(bytes_of(gateway), index_);
    } else if (const nlattr* via = attributes[RTA_VIA]) {
      // A gateway of another family (RFC 8950): struct rtvia, a family before the address.
      const auto bytes = bytes_of(via);
      entry.neighbour = address_of(bytes.subspan(std::min(sizeof(rtvia), bytes.size())), index_);
    }
    const nlattr* preferred = attributes[RTA_PREFSRC];
    if (source.size == 0 && preferred != nullptr) {
      entry.source = address_of(bytes_of(preferred), index_);
    }
  });
  return result >= 0 && routed && entry.neighbour.size > 0 && entry.source.size > 0;
}

std::uint16_t NextHops::read_neighbour(Entry& entry) {
  const netlink::Message request(nlmsg_alloc_simple(RTM_GETNEIGH, NLM_F_REQUEST));
  ndmsg header{};
  header.ndm_family = static_cast<unsigned char>(family_of(entry.neighbour));
  header.ndm_ifindex = index_;
  if (!request || nlmsg_append(request.get(), &header, sizeof header, NLMSG_ALIGNTO) < 0 ||
      put(request.get(), NDA_DST, entry.neighbour) < 0) {
    return 0;
  }
  std::uint16_t state = 0;
  netlink::ask(requests_.get(), request.get(), [&](const nlmsghdr& message) {
    std::array<nlattr*, NDA_MAX + 1> attributes{};
    if (message.nlmsg_type != RTM_NEWNEIGH || !parse<ndmsg>(message, attributes)) return;
    state = static_cast<const ndmsg*>(NLMSG_DATA(&message))->ndm_state;
    const nlattr* address = attributes[NDA_LLADDR];
    if (address != nullptr && bytes_of(address).size() == entry.mac.size()) {
      std::ranges::copy(bytes_of(address), entry.mac.begin());
    } else {
      state &= static_cast<std::uint16_t>(~kValid);
    }
  });
  return state;
}

void NextHops::ask_for(const Address& neighbour) {
  const netlink::Message request(
      nlmsg_alloc_simple(RTM_NEWNEIGH, NLM_F_REQUEST | NLM_F_ACK | NLM_F_CREATE));
  ndmsg header{};
  header.ndm_family = static_cast<unsigned char>(family_of(neighbour));
  header.ndm_ifindex = index_;
  header.ndm_flags = NTF_USE;
  if (request && nlmsg_append(request.get(), &header, sizeof header, NLMSG_ALIGNTO) >= 0 &&
      put(request.get(), NDA_DST, neighbour) >= 0 &&
      netlink::ask(requests_.get(), request.get(), [](const nlmsghdr&) {}) >= 0) {
    return;
  }
  const Address discard = with_port(neighbour, kDiscardPort);
  // Whether it leaves does not matter: the next look at the neighbour tells.
  [[maybe_unused]] const auto sent =
      ::sendto(helper_, nullptr, 0, MSG_DONTWAIT | MSG_NOSIGNAL,
               reinterpret_cast<const sockaddr*>(discard.raw.data()), discard.size);
}

NextHops::Changes NextHops::take_events(TimePoint now) {
  if (now < next_look_) return {};
  next_look_ = now + kEventInterval;
  Changes changes;
  const bool complete =
      netlink::drain(events_.get(), [&](const nlmsghdr& message) { apply(message, changes); });
  if (!complete) {
    changes.card = true;
    for (auto& [key, entry] : entries_) entry.stale = true;
  }
  return changes;
}

std::optional<Nic> NextHops::read_card() {
  NicTable table;
  try {
    table.read(requests_.get(), false);
  } catch (const IoError&) {
    return std::nullopt;
  }
  const Nic* nic = table.find(index_);
  return nic != nullptr ? std::optional(*nic) : std::nullopt;
}

void NextHops::apply(const nlmsghdr& message, Changes& changes) {
  switch (message.nlmsg_type) {
    case RTM_NEWNEIGH:
    case RTM_DELNEIGH: {
      std::array<nlattr*, NDA_MAX + 1> attributes{};
      const auto* header = static_cast<const ndmsg*>(NLMSG_DATA(&message));
      if (!parse<ndmsg>(message, attributes) || header->ndm_ifindex != index_ ||
          attributes[NDA_DST] == nullptr) {
        return;
      }
      for (auto& [key, entry] : entries_) {
        if (entry.neighbour.size > 0 &&
            std::ranges::equal(host_bytes(entry.neighbour), bytes_of(attributes[NDA_DST]))) {
          entry.stale = true;
        }
      }
      return;
    }
    case RTM_NEWLINK:
    case RTM_DELLINK: {
      const auto* header = static_cast<const ifinfomsg*>(NLMSG_DATA(&message));
      // Bridges tell of their ports by the same message with a family of their own.
      if (header->ifi_index != index_ || header->ifi_family != AF_UNSPEC) return;
      changes.card = true;
      changes.gone = changes.gone || message.nlmsg_type == RTM_DELLINK;
      // What was asked while there was no carrier was lost, and is asked again at once.
      for (auto& [key, entry] : entries_) entry.asked.reset();
      break;
    }
    case RTM_NEWADDR:
    case RTM_DELADDR: {
      const auto* header = static_cast<const ifaddrmsg*>(NLMSG_DATA(&message));
      if (header->ifa_index != static_cast<std::uint32_t>(index_)) return;
      changes.card = true;
      break;
    }
    default:
      break;
  }
  // A route, a rule, an address or the device: any peer may be reached otherwise now.
  for (auto& [key, entry] : entries_) entry.stale = true;
}

}  // namespace interneuron::io
