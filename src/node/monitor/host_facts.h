// What this host's kernel is set to where several network cards (NICs) are used at once:
// facts without judgement, which is for src/app/doctor/. Reading them sends nothing and changes
// nothing. What cannot be read is empty. Throws IoError only when the NICs cannot be listed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "interneuron/link.h"
#include "node/io/nic.h"

namespace interneuron::io {

// An address of a NIC, as the source of packets.
struct SourceFacts {
  Address address{};
  // Bits of the subnet.
  int prefix = 0;
  // An IPv6 privacy address, which will be replaced.
  bool temporary = false;
  // The target is routed for a socket that is bound to the NIC and to this address.
  bool routed = false;
  // The NIC by which packets leave that are bound to this address but to no NIC; empty: no route.
  std::string leaves_by;
};

struct NicHostFacts {
  Nic nic;
  NicState state{};
  std::string reason;
  // IPv4 first.
  std::vector<SourceFacts> sources;
  // The target is routed for a socket that is bound to the NIC alone.
  bool routed = false;
  // The gateway of a default route through it, in any routing table.
  std::optional<Address> table_gateway;
  // The MTU that the kernel has learnt of the path, bytes.
  std::optional<std::size_t> route_mtu;
  // The errno of SO_BINDTODEVICE for this process; 0: it works.
  int bind_error = 0;
  std::string qdisc;
  // The driver stamps packets in software when they leave.
  bool send_timestamps = false;
  bool hardware_timestamps = false;
  // net.ipv4.conf.NIC.* and net.ipv6.conf.NIC.*; those of "all" NICs are in HostFacts.
  std::optional<int> rp_filter;
  std::optional<int> arp_ignore;
  std::optional<int> arp_announce;
  std::optional<int> use_tempaddr;
};

struct HostFacts {
  // The address that routes were asked for: a peer's, or an address of the Internet that nobody
  // has.
  Address target{};
  bool target_is_peer = false;
  std::vector<NicHostFacts> nics;
  std::optional<int> rp_filter_all;
  std::optional<int> arp_ignore_all;
  std::optional<int> arp_announce_all;
  // net.core.rmem_max and wmem_max, bytes.
  std::optional<std::size_t> rmem_max;
  std::optional<std::size_t> wmem_max;
  // net.ipv4.ip_no_pmtu_disc.
  std::optional<int> no_pmtu_disc;
  // How long this host's own connection tracking keeps a UDP mapping, in seconds, if it tracks at
  // all: after packets one way, and after packets both ways.
  std::optional<int> conntrack_udp_s;
  std::optional<int> conntrack_udp_stream_s;
  // What UDP sockets of this process cannot do: the errno of each socket option, 0: it works. In
  // this order: UDP_SEGMENT, UDP_GRO, SO_TIMESTAMPING in software, IP_MTU_DISCOVER = PROBE,
  // IP_RECVERR, SO_RXQ_OVFL, SO_PRIORITY 6 with TOS EF, SO_TXTIME.
  int segmentation_error = 0;
  int gro_error = 0;
  int timestamping_error = 0;
  int discover_error = 0;
  int error_queue_error = 0;
  int drop_count_error = 0;
  int priority_error = 0;
  int txtime_error = 0;
};

// Routes are asked for `peer` or, without one, for an address of the Internet.
HostFacts read_host_facts(const std::optional<Address>& peer);

}  // namespace interneuron::io
