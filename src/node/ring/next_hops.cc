#include "node/ring/next_hops.h"

#include <linux/neighbour.h>
#include <linux/rtnetlink.h>
#include <netlink/attr.h>
#include <netlink/errno.h>
#include <sys/socket.h>

#include <algorithm>
#include <span>

#include "interneuron/transport.h"
#include "node/io/address.h"
#include "node/monitor/netlink_message.h"
#include "node/monitor/nic_table.h"

namespace interneuron::io {

namespace {

// For the events of a burst of changes.
constexpr std::size_t kEventBufferBytes = 256 * 1024;
// RFC 863.
constexpr std::uint16_t kDiscardPort = 9;
// States of a neighbour whose hardware address can be used (NUD_VALID of Linux).
constexpr unsigned kValid =
    NUD_PERMANENT | NUD_NOARP | NUD_REACHABLE | NUD_PROBE | NUD_STALE | NUD_DELAY;

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
  std::ranges::copy(netlink::host_bytes(to), key.first.begin());
  if (source.size > 0) std::ranges::copy(netlink::host_bytes(source), key.second.begin());
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
  const auto bits = static_cast<unsigned char>(netlink::host_bytes(to).size() * 8);
  rtmsg header{};
  header.rtm_family = static_cast<unsigned char>(family_of(to));
  header.rtm_dst_len = bits;
  header.rtm_src_len = source.size > 0 ? bits : 0;
  if (!request || nlmsg_append(request.get(), &header, sizeof header, NLMSG_ALIGNTO) < 0 ||
      netlink::put(request.get(), RTA_DST, to) < 0 ||
      nla_put_u32(request.get(), RTA_OIF, static_cast<std::uint32_t>(index_)) < 0 ||
      (source.size > 0 && netlink::put(request.get(), RTA_SRC, source) < 0)) {
    return false;
  }
  bool routed = false;
  entry.source = source;
  entry.neighbour = to;
  const int result = netlink::ask(requests_.get(), request.get(), [&](const nlmsghdr& message) {
    const auto answer = netlink::route_answer(message, index_);
    if (!answer) return;
    routed = true;
    if (answer->gateway.size > 0) entry.neighbour = answer->gateway;
    if (source.size == 0 && answer->source.size > 0) entry.source = answer->source;
  });
  return result >= 0 && routed && entry.neighbour.size > 0 && entry.source.size > 0;
}

std::uint16_t NextHops::read_neighbour(Entry& entry) {
  const netlink::Message request(nlmsg_alloc_simple(RTM_GETNEIGH, NLM_F_REQUEST));
  ndmsg header{};
  header.ndm_family = static_cast<unsigned char>(family_of(entry.neighbour));
  header.ndm_ifindex = index_;
  if (!request || nlmsg_append(request.get(), &header, sizeof header, NLMSG_ALIGNTO) < 0 ||
      netlink::put(request.get(), NDA_DST, entry.neighbour) < 0) {
    return 0;
  }
  std::uint16_t state = 0;
  netlink::ask(requests_.get(), request.get(), [&](const nlmsghdr& message) {
    const auto found = netlink::neighbour(message);
    if (!found || message.nlmsg_type != RTM_NEWNEIGH) return;
    state = found->state;
    if (found->mac) {
      entry.mac = *found->mac;
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
      netlink::put(request.get(), NDA_DST, neighbour) >= 0 &&
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
      const auto found = netlink::neighbour(message);
      if (!found || found->card != index_) return;
      for (auto& [key, entry] : entries_) {
        if (entry.neighbour.size > 0 &&
            std::ranges::equal(netlink::host_bytes(entry.neighbour), found->address)) {
          entry.stale = true;
        }
      }
      return;
    }
    case RTM_NEWLINK:
    case RTM_DELLINK:
      if (netlink::card_of(message) != index_) return;
      changes.card = true;
      changes.gone = changes.gone || message.nlmsg_type == RTM_DELLINK;
      // What was asked while there was no carrier was lost, and is asked again at once.
      for (auto& [key, entry] : entries_) entry.asked.reset();
      break;
    case RTM_NEWADDR:
    case RTM_DELADDR:
      if (netlink::card_of(message) != index_) return;
      changes.card = true;
      break;
    default:
      break;
  }
  // A route, a rule, an address or the device: any peer may be reached otherwise now.
  for (auto& [key, entry] : entries_) entry.stale = true;
}

}  // namespace interneuron::io
