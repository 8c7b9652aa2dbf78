// What this host's kernel is set to where several network cards (NICs) are used at once:
// facts without judgement, which is for src/app/doctor/. Reading them sends nothing and changes
// nothing. What cannot be read is empty. Throws IoError only when the NICs cannot be listed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/io/nic.h"
#include "interneuron/link.h"

namespace interneuron::io {

// An address of a NIC, as the source of packets.
struct SourceFacts {
  Address address{};
  int prefix = 0;          // bits of the subnet
  bool temporary = false;  // IPv6 privacy address: it will be replaced
  bool routed = false;     // the target is routed for a socket bound to the NIC and this address
  std::string leaves_by;   // NIC by which it goes without being bound to one; empty: no route
};

struct NicHostFacts {
  Nic nic;
  NicState state{};
  std::string reason;
  std::vector<SourceFacts> sources;  // IPv4 first
  bool routed = false;  // the target is routed for a socket that is bound to the NIC alone
  std::optional<Address> table_gateway;  // of a default route through it in any table
  std::optional<std::size_t> route_mtu;  // what the kernel has learnt of the path, bytes
  int bind_error = 0;                    // errno of SO_BINDTODEVICE for this process, 0: it works
  std::string qdisc;
  bool send_timestamps = false;  // software stamps when a packet leaves
  bool hardware_timestamps = false;
  // net.ipv4.conf.NIC.*, net.ipv6.conf.NIC.*; "all" is in HostFacts
  std::optional<int> rp_filter;
  std::optional<int> arp_ignore;
  std::optional<int> arp_announce;
  std::optional<int> use_tempaddr;
};

struct HostFacts {
  Address target{};             // what routes were asked for
  bool target_is_peer = false;  // else: an address of the Internet that nobody has
  std::vector<NicHostFacts> nics;
  std::optional<int> rp_filter_all;
  std::optional<int> arp_ignore_all;
  std::optional<int> arp_announce_all;
  std::optional<std::size_t> rmem_max;  // net.core.*, bytes
  std::optional<std::size_t> wmem_max;
  std::optional<int> no_pmtu_disc;            // net.ipv4.ip_no_pmtu_disc
  std::optional<int> conntrack_udp_s;         // of this host, if it tracks connections
  std::optional<int> conntrack_udp_stream_s;  // after packets both ways
  // What UDP sockets of this process cannot do: errno, 0 = it works.
  int segmentation_error = 0;  // UDP_SEGMENT
  int gro_error = 0;           // UDP_GRO
  int timestamping_error = 0;  // SO_TIMESTAMPING, software
  int discover_error = 0;      // IP_MTU_DISCOVER = PROBE
  int error_queue_error = 0;   // IP_RECVERR
  int drop_count_error = 0;    // SO_RXQ_OVFL
  int priority_error = 0;      // SO_PRIORITY 6, TOS EF
  int txtime_error = 0;        // SO_TXTIME
};

// Routes are asked for `peer`, else for an address of the Internet.
HostFacts read_host_facts(const std::optional<Address>& peer);

}  // namespace interneuron::io
