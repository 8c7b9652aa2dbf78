#include "netns/wiring/wiring.h"

#include <linux/if.h>
#include <linux/rtnetlink.h>
#include <netlink/msg.h>
#include <sys/epoll.h>

#include <array>

#include "netns/state/check.h"
#include "netns/wiring/nics.h"

namespace interneuron::netns {

using netlink::check_nl;

namespace {

constexpr std::size_t kHostsAtOnce = 16;

}  // namespace

NicKeeper::NicKeeper(const State& state, const TestbedOptions& options,
                     const Namespaces& namespaces)
    : changes_(check(::epoll_create1(EPOLL_CLOEXEC), "watch the NICs")) {
  for (const HostPlan& host : plan_hosts(state, options)) {
    const NetworkNamespaceScope scope(network_of(namespaces, host.host), namespaces.air.get());
    hosts_.push_back(watch(host));
  }
  for (std::size_t i = 0; i < hosts_.size(); ++i) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = i;
    check(::epoll_ctl(changes_.get(), EPOLL_CTL_ADD, nl_socket_get_fd(hosts_[i].events.get()),
                      &event),
          "watch the NICs");
  }
}

NicKeeper::HostNics NicKeeper::watch(const HostPlan& host) {
  HostNics out{netlink::open_socket(), netlink::open_socket(), {}};
  nl_sock* events = out.events.get();
  // Events answer no request, so they have no sequence number to be checked.
  nl_socket_disable_seq_check(events);
  check_nl(nl_socket_set_nonblocking(events), "watch the NICs");
  check_nl(nl_socket_add_membership(events, RTNLGRP_LINK), "watch the NICs");
  for (const NicPlan& plan : host.nics) {
    out.nics.push_back({plan, netlink::nic_index(plan.nic)});
  }
  return out;
}

void NicKeeper::serve() {
  std::array<epoll_event, kHostsAtOnce> events{};
  const int count = ::epoll_wait(changes_.get(), events.data(), events.size(), 0);
  for (int i = 0; i < count; ++i) serve(hosts_[events[static_cast<std::size_t>(i)].data.u64]);
}

void NicKeeper::serve(HostNics& host) {
  nl_socket_modify_cb(host.events.get(), NL_CB_VALID, NL_CB_CUSTOM, &NicKeeper::take_event, &host);
  while (nl_recvmsgs_default(host.events.get()) >= 0) {
  }
}

int NicKeeper::take_event(nl_msg* message, void* host) {
  auto& [requests, events, nics] = *static_cast<HostNics*>(host);
  const nlmsghdr* header = nlmsg_hdr(message);
  if (header->nlmsg_type != RTM_NEWLINK) return NL_OK;
  const auto* link = static_cast<const ifinfomsg*>(nlmsg_data(header));
  for (Nic& nic : nics) {
    if (nic.index != link->ifi_index) continue;
    const bool up = (link->ifi_flags & IFF_UP) != 0;
    if (std::exchange(nic.up, up) || !up) continue;
    try {
      configure(requests.get(), nic.plan, nic.index);
    } catch (const TestbedError&) {
      // The NIC has been set down again or removed meanwhile, which its user may do.
    }
  }
  return NL_OK;
}

}  // namespace interneuron::netns
