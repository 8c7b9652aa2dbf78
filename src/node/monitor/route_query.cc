#include "node/monitor/route_query.h"

#include <linux/rtnetlink.h>
#include <netlink/attr.h>

#include <cstring>
#include <span>

#include "node/io/address.h"
#include "node/monitor/netlink_message.h"

namespace interneuron::io {

namespace {

// The bytes of the bare address.
std::span<const std::byte> host_bytes(const Address& address) {
  if (family_of(address) == AF_INET) {
    return std::span(address.raw).subspan(offsetof(sockaddr_in, sin_addr), sizeof(in_addr));
  }
  return std::span(address.raw).subspan(offsetof(sockaddr_in6, sin6_addr), sizeof(in6_addr));
}

int put(nl_msg* message, int type, const Address& address) {
  const auto bytes = host_bytes(address);
  return nla_put(message, type, static_cast<int>(bytes.size()), bytes.data());
}

}  // namespace

bool is_routed(nl_sock* requests, int index, const Address& peer,
               const std::optional<Address>& source) {
  const netlink::Message request(nlmsg_alloc_simple(RTM_GETROUTE, NLM_F_REQUEST));
  if (!request || peer.size == 0) return false;
  const auto bits = static_cast<unsigned char>(host_bytes(peer).size() * 8);
  rtmsg header{};
  header.rtm_family = static_cast<unsigned char>(family_of(peer));
  header.rtm_dst_len = bits;
  header.rtm_src_len = source ? bits : 0;
  header.rtm_flags = RTM_F_FIB_MATCH;
  if (nlmsg_append(request.get(), &header, sizeof header, NLMSG_ALIGNTO) < 0 ||
      put(request.get(), RTA_DST, peer) < 0 ||
      nla_put_u32(request.get(), RTA_OIF, static_cast<std::uint32_t>(index)) < 0 ||
      (source && put(request.get(), RTA_SRC, *source) < 0)) {
    return false;
  }
  bool routed = false;
  const int result = netlink::ask(requests, request.get(), [&](const nlmsghdr& message) {
    routed = routed || netlink::leads_through(message, index);
  });
  return result >= 0 && routed;
}

}  // namespace interneuron::io
