#include "host/io/neighbours.h"

#include <linux/neighbour.h>
#include <linux/rtnetlink.h>
#include <netlink/attr.h>
#include <netlink/errno.h>

#include <array>
#include <vector>

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
    const auto* header = static_cast<const ndmsg*>(NLMSG_DATA(&message));
    std::array<nlattr*, NDA_MAX + 1> attributes{};
    if (message.nlmsg_type != RTM_NEWNEIGH || header->ndm_ifindex != index ||
        header->ndm_state != NUD_INCOMPLETE ||
        nlmsg_parse(const_cast<nlmsghdr*>(&message), sizeof *header, attributes.data(), NDA_MAX,
                    nullptr) < 0 ||
        attributes[NDA_DST] == nullptr) {
      return;
    }
    const auto* bytes = static_cast<const std::byte*>(nla_data(attributes[NDA_DST]));
    out.push_back({*header, {bytes, bytes + nla_len(attributes[NDA_DST])}});
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
