#include "node/monitor/route_query.h"

#include <linux/neighbour.h>
#include <linux/rtnetlink.h>
#include <netlink/attr.h>
#include <netlink/errno.h>
#include <span>
#include <vector>

#include "node/io/address.h"
#include "node/monitor/netlink_message.h"

namespace interneuron::io {
namespace {

// A neighbour as it is named to the kernel.
struct Question {
  ndmsg header{};
  std::vector<std::byte> address;
};

std::vector<Question> unanswered(nl_sock* requests, int index) {
  std::vector<Question> out;
  netlink::list(requests, RTM_GETNEIGH, [&](const nlmsghdr& message) {
    const auto found = netlink::neighbour(message);
    if (!found || message.nlmsg_type != RTM_NEWNEIGH || found->card != index ||
        found->state != NUD_INCOMPLETE) {
      return;
    }
    out.push_back(
        {*netlink::header_of<ndmsg>(message), {found->address.begin(), found->address.end()}});
  });
  return out;
}

}  // namespace

bool is_routed(nl_sock* requests, int index, const Address& peer,
               const std::optional<Address>& source) {
  const netlink::Message request(nlmsg_alloc_simple(RTM_GETROUTE, NLM_F_REQUEST));
  if (!request || peer.size == 0) return false;
  const auto bits = static_cast<unsigned char>(netlink::host_bytes(peer).size() * 8);
  rtmsg header{};
  header.rtm_family = static_cast<unsigned char>(family_of(peer));
  header.rtm_dst_len = bits;
  header.rtm_src_len = source ? bits : 0;
  header.rtm_flags = RTM_F_FIB_MATCH;
  if (nlmsg_append(request.get(), &header, sizeof header, NLMSG_ALIGNTO) < 0 ||
      netlink::put(request.get(), RTA_DST, peer) < 0 ||
      nla_put_u32(request.get(), RTA_OIF, static_cast<std::uint32_t>(index)) < 0 ||
      (source && netlink::put(request.get(), RTA_SRC, *source) < 0)) {
    return false;
  }
  bool routed = false;
  const int result = netlink::ask(requests, request.get(), [&](const nlmsghdr& message) {
    routed = routed || netlink::leads_through(message, index);
  });
  return result >= 0 && routed;
}

bool drop_unanswered_neighbours(nl_sock* requests, int index) {
  for (const Question& question : unanswered(requests, index)) {
    const netlink::Message request(nlmsg_alloc_simple(RTM_DELNEIGH, NLM_F_REQUEST | NLM_F_ACK));
    ndmsg header = question.header;
    if (!request || nlmsg_append(request.get(), &header, sizeof header, NLMSG_ALIGNTO) < 0 ||
        nla_put(request.get(), NDA_DST, static_cast<int>(question.address.size()),
                question.address.data()) < 0 ||
        netlink::ask(requests, request.get(), [](const nlmsghdr&) {}) == -NLE_PERM) {
      return false;
    }
  }
  return true;
}

}  // namespace interneuron::io
