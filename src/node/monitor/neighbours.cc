#include "node/monitor/neighbours.h"

#include <linux/neighbour.h>
#include <linux/rtnetlink.h>
#include <netlink/attr.h>
#include <netlink/errno.h>

#include <vector>

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
