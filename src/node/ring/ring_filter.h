// The packet filter (classic BPF, man 7 socket, SO_ATTACH_FILTER) by which the kernel passes to a
// RingTransport only what is for its port, before anything is copied.
//
// It passes frames to this host (not those to others that a card in promiscuous mode sees) with UDP
// to the port, also behind options of IPv4 and behind at most two VLAN tags in the frame; and first
// fragments of such packets, so that they can be counted. Later fragments name no port and are
// dropped. It is a sieve and no judge: what it passes is read by parse_frame(). A filter reads
// nothing beyond a frame; one that is too short is dropped.
//
// Pure values. Thread-safe; no errors.
#pragma once

#include <linux/filter.h>

#include <cstdint>
#include <vector>

namespace interneuron::io {

struct RingFilter {
  // Whether frames begin with an Ethernet header; else with the IP header.
  bool ethernet = true;
  bool ipv6 = false;
  std::uint16_t port = 0;
};

// At most 80 instructions.
std::vector<sock_filter> ring_filter(const RingFilter& wanted);

// Passes nothing: for the UDP socket that only holds the port.
std::vector<sock_filter> drop_all_filter();

}  // namespace interneuron::io
