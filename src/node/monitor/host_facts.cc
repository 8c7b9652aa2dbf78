#include "node/monitor/host_facts.h"

#include <linux/ethtool.h>
#include <linux/if_addr.h>
#include <linux/net_tstamp.h>
#include <linux/rtnetlink.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <netlink/attr.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "node/io/address.h"
#include "node/io/file_descriptor.h"
#include "node/monitor/link_monitor.h"
#include "node/monitor/netlink.h"
#include "node/monitor/route_query.h"

namespace interneuron::io {

namespace {

// Addresses reserved for documentation (RFC 5737, RFC 3849). Nobody has them, so only a default
// route leads there.
constexpr const char* kInternet4 = "198.51.100.1";
constexpr const char* kInternet6 = "2001:db8::1";

template <class Number>
std::optional<Number> sysctl(const std::string& path) {
  std::ifstream file("/proc/sys/net/" + path);
  Number value{};
  if (!(file >> value)) return std::nullopt;
  return value;
}

FileDescriptor udp_socket(int family = AF_INET) {
  return FileDescriptor(::socket(family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
}

template <class Value>
int set_error(int level, int option, const Value& value) {
  const FileDescriptor socket = udp_socket();
  if (socket.get() < 0) return errno;
  return ::setsockopt(socket.get(), level, option, &value, sizeof value) == 0 ? 0 : errno;
}

int bind_error(const std::string& nic) {
  const FileDescriptor socket = udp_socket();
  if (socket.get() < 0) return errno;
  const auto size = static_cast<socklen_t>(nic.size());
  return ::setsockopt(socket.get(), SOL_SOCKET, SO_BINDTODEVICE, nic.data(), size) == 0 ? 0 : errno;
}

void read_socket_options(HostFacts& f) {
  f.segmentation_error = set_error(IPPROTO_UDP, UDP_SEGMENT, 1400);
  f.gro_error = set_error(IPPROTO_UDP, UDP_GRO, 1);
  const int stamps = SOF_TIMESTAMPING_TX_SOFTWARE | SOF_TIMESTAMPING_RX_SOFTWARE |
                     SOF_TIMESTAMPING_SOFTWARE | SOF_TIMESTAMPING_OPT_ID;
  f.timestamping_error = set_error(SOL_SOCKET, SO_TIMESTAMPING, stamps);
  f.discover_error = set_error(IPPROTO_IP, IP_MTU_DISCOVER, IP_PMTUDISC_PROBE);
  f.error_queue_error = set_error(IPPROTO_IP, IP_RECVERR, 1);
  f.drop_count_error = set_error(SOL_SOCKET, SO_RXQ_OVFL, 1);
  f.priority_error = set_error(SOL_SOCKET, SO_PRIORITY, 6);
  // The code point of RFC 3246 in the TOS byte.
  constexpr int kExpeditedForwarding = 46 << 2;
  if (f.priority_error == 0) f.priority_error = set_error(IPPROTO_IP, IP_TOS, kExpeditedForwarding);
  sock_txtime txtime{};
  txtime.clockid = CLOCK_MONOTONIC;
  f.txtime_error = set_error(SOL_SOCKET, SO_TXTIME, txtime);
}

void read_sysctls(HostFacts& f) {
  f.rp_filter_all = sysctl<int>("ipv4/conf/all/rp_filter");
  f.arp_ignore_all = sysctl<int>("ipv4/conf/all/arp_ignore");
  f.arp_announce_all = sysctl<int>("ipv4/conf/all/arp_announce");
  f.rmem_max = sysctl<std::size_t>("core/rmem_max");
  f.wmem_max = sysctl<std::size_t>("core/wmem_max");
  f.no_pmtu_disc = sysctl<int>("ipv4/ip_no_pmtu_disc");
  f.conntrack_udp_s = sysctl<int>("netfilter/nf_conntrack_udp_timeout");
  f.conntrack_udp_stream_s = sysctl<int>("netfilter/nf_conntrack_udp_timeout_stream");
}

void read_timestamps(NicHostFacts& f) {
  const FileDescriptor socket = udp_socket();
  ethtool_ts_info info{};
  info.cmd = ETHTOOL_GET_TS_INFO;
  ifreq request{};
  f.nic.name.copy(request.ifr_name, IFNAMSIZ - 1);
  request.ifr_data = reinterpret_cast<char*>(&info);
  if (::ioctl(socket.get(), SIOCETHTOOL, &request) != 0) return;
  f.send_timestamps = (info.so_timestamping & SOF_TIMESTAMPING_TX_SOFTWARE) != 0;
  f.hardware_timestamps = (info.so_timestamping & SOF_TIMESTAMPING_TX_HARDWARE) != 0;
}

// --- routing

Address address_of(int family, const nlattr* attribute) {
  Address none{};
  if (attribute == nullptr) return none;
  const void* bytes = nla_data(attribute);
  if (family == AF_INET && nla_len(attribute) >= static_cast<int>(sizeof(in_addr))) {
    sockaddr_in in{};
    in.sin_family = AF_INET;
    std::memcpy(&in.sin_addr, bytes, sizeof in.sin_addr);
    return from_sockaddr(reinterpret_cast<const sockaddr*>(&in), sizeof in);
  }
  if (family == AF_INET6 && nla_len(attribute) >= static_cast<int>(sizeof(in6_addr))) {
    sockaddr_in6 in{};
    in.sin6_family = AF_INET6;
    std::memcpy(&in.sin6_addr, bytes, sizeof in.sin6_addr);
    return from_sockaddr(reinterpret_cast<const sockaddr*>(&in), sizeof in);
  }
  return none;
}

const nlattr* find(const nlmsghdr& message, int header, int type) {
  return nlmsg_find_attr(const_cast<nlmsghdr*>(&message), header, type);
}

struct Way {
  // The NIC's index; 0 when there is no route.
  int index = 0;
  std::optional<std::size_t> mtu;
};

int put_host(nl_msg* message, int type, const Address& address) {
  if (is_ipv6(address)) {
    return nla_put(message, type, sizeof(in6_addr),
                   address.raw.data() + offsetof(sockaddr_in6, sin6_addr));
  }
  return nla_put(message, type, sizeof(in_addr),
                 address.raw.data() + offsetof(sockaddr_in, sin_addr));
}

// The way that a packet takes when it must leave by the NIC `oif`; 0 stands for any NIC.
Way way_of(nl_sock* requests, const Address& to, const std::optional<Address>& from, int oif) {
  Way way;
  const netlink::Message request(nlmsg_alloc_simple(RTM_GETROUTE, NLM_F_REQUEST));
  rtmsg header{};
  header.rtm_family = static_cast<unsigned char>(family_of(to));
  const unsigned char bits = is_ipv6(to) ? 128 : 32;
  header.rtm_dst_len = bits;
  header.rtm_src_len = from ? bits : 0;
  if (!request || nlmsg_append(request.get(), &header, sizeof header, NLMSG_ALIGNTO) < 0 ||
      put_host(request.get(), RTA_DST, to) < 0 ||
      (from && put_host(request.get(), RTA_SRC, *from) < 0) ||
      (oif != 0 && nla_put_u32(request.get(), RTA_OIF, static_cast<std::uint32_t>(oif)) < 0)) {
    return way;
  }
  netlink::ask(requests, request.get(), [&](const nlmsghdr& message) {
    if (message.nlmsg_type != RTM_NEWROUTE) return;
    const auto* route = static_cast<const rtmsg*>(nlmsg_data(&message));
    if (route->rtm_type != RTN_UNICAST && route->rtm_type != RTN_LOCAL) return;
    if (const nlattr* out = find(message, sizeof(rtmsg), RTA_OIF)) {
      way.index = static_cast<int>(nla_get_u32(out));
    }
    const nlattr* metrics = find(message, sizeof(rtmsg), RTA_METRICS);
    if (metrics == nullptr) return;
    if (const nlattr* mtu =
            nla_find(static_cast<nlattr*>(nla_data(metrics)), nla_len(metrics), RTAX_MTU)) {
      way.mtu = nla_get_u32(mtu);
    }
  });
  return way;
}

std::vector<SourceFacts> sources_of(nl_sock* requests, int index) {
  std::vector<SourceFacts> sources;
  netlink::list(requests, RTM_GETADDR, [&](const nlmsghdr& message) {
    if (message.nlmsg_type != RTM_NEWADDR) return;
    const auto* header = static_cast<const ifaddrmsg*>(nlmsg_data(&message));
    if (static_cast<int>(header->ifa_index) != index) return;
    SourceFacts source;
    const nlattr* local = find(message, sizeof(ifaddrmsg), IFA_LOCAL);
    if (local == nullptr) local = find(message, sizeof(ifaddrmsg), IFA_ADDRESS);
    source.address = address_of(header->ifa_family, local);
    source.prefix = header->ifa_prefixlen;
    source.temporary = (header->ifa_flags & IFA_F_TEMPORARY) != 0;
    if (source.address.size != 0) sources.push_back(source);
  });
  std::stable_partition(sources.begin(), sources.end(),
                        [](const SourceFacts& s) { return !is_ipv6(s.address); });
  return sources;
}

// The gateway of a default route through the NIC, in any table: a source rule's own table counts
// too.
std::optional<Address> gateway_of(nl_sock* requests, int index, int family) {
  std::optional<Address> gateway;
  netlink::list(requests, RTM_GETROUTE, [&](const nlmsghdr& message) {
    if (message.nlmsg_type != RTM_NEWROUTE) return;
    const auto* route = static_cast<const rtmsg*>(nlmsg_data(&message));
    const nlattr* out = find(message, sizeof(rtmsg), RTA_OIF);
    if (route->rtm_family != family || route->rtm_dst_len != 0 || out == nullptr ||
        static_cast<int>(nla_get_u32(out)) != index) {
      return;
    }
    const Address found = address_of(family, find(message, sizeof(rtmsg), RTA_GATEWAY));
    if (found.size != 0) gateway = found;
  });
  return gateway;
}

std::string qdisc_of(nl_sock* requests, int index) {
  std::string qdisc;
  netlink::list(requests, RTM_GETLINK, [&](const nlmsghdr& message) {
    if (message.nlmsg_type != RTM_NEWLINK) return;
    const auto* link = static_cast<const ifinfomsg*>(nlmsg_data(&message));
    if (link->ifi_index != index) return;
    if (const nlattr* name = find(message, sizeof(ifinfomsg), IFLA_QDISC)) {
      qdisc = nla_get_string(const_cast<nlattr*>(name));
    }
  });
  return qdisc;
}

void read_routes(nl_sock* requests, const HostFacts& host, NicHostFacts& f,
                 const std::vector<Nic>& nics) {
  const int index = f.nic.index;
  const Address internet6 = *make_address(kInternet6, 0);
  // Without a peer, a NIC that has IPv6 only is asked for the IPv6 Internet.
  const bool only6 =
      !host.target_is_peer && !f.sources.empty() && is_ipv6(f.sources.front().address);
  const Address target = only6 ? internet6 : host.target;
  f.routed = is_routed(requests, index, target, std::nullopt);
  f.route_mtu = way_of(requests, target, std::nullopt, index).mtu;
  f.table_gateway = gateway_of(requests, index, family_of(target));
  for (SourceFacts& source : f.sources) {
    if (is_ipv6(source.address) != is_ipv6(target)) continue;
    if (is_ipv6(source.address) && is_link_local(source.address)) continue;
    source.routed = is_routed(requests, index, target, source.address);
    const Way way = way_of(requests, target, source.address, 0);
    for (const Nic& nic : nics) {
      if (nic.index == way.index) source.leaves_by = nic.name;
    }
  }
}

}  // namespace

HostFacts read_host_facts(const std::optional<Address>& peer) {
  HostFacts host;
  host.target_is_peer = peer.has_value();
  host.target = peer ? *peer : *make_address(kInternet4, 0);
  read_sysctls(host);
  read_socket_options(host);

  LinkMonitor monitor;
  const netlink::Socket requests = netlink::open_socket();
  for (const Nic& nic : monitor.nics()) {
    if (peer) monitor.require_route(nic.name, *peer);
    NicHostFacts f;
    f.nic = nic;
    f.state = monitor.state(nic.name);
    f.reason = monitor.reason(nic.name);
    f.sources = sources_of(requests.get(), nic.index);
    read_routes(requests.get(), host, f, monitor.nics());
    f.bind_error = bind_error(nic.name);
    f.qdisc = qdisc_of(requests.get(), nic.index);
    read_timestamps(f);
    const std::string conf = "/conf/" + nic.name + "/";
    f.rp_filter = sysctl<int>("ipv4" + conf + "rp_filter");
    f.arp_ignore = sysctl<int>("ipv4" + conf + "arp_ignore");
    f.arp_announce = sysctl<int>("ipv4" + conf + "arp_announce");
    f.use_tempaddr = sysctl<int>("ipv6" + conf + "use_tempaddr");
    host.nics.push_back(std::move(f));
  }
  return host;
}

}  // namespace interneuron::io
