// Measures how large a packet may be on the way to a host through one network card (NIC): sends
// echo requests (ping) of rising size with "don't fragment", some ten packets, and waits for their
// answers. Anybody can forge answers and the routers' errors (ICMP); the result is shown to people
// and decides nothing. Thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "interneuron/transport.h"

namespace interneuron::io {

struct PathMtu {
  std::string nic;
  // Packets of the IP layer, bytes, in rising order, and which were answered.
  struct Probe {
    std::size_t bytes = 0;
    bool answered = false;
  };
  std::vector<Probe> probes;
  // A router's word (ICMP) or the NIC's own limit, bytes, if any came.
  std::optional<std::size_t> told;
  // The errno when no echo request may be sent at all (net.ipv4.ping_group_range, CAP_NET_RAW); 0
  // when they may.
  int error = 0;
};

// `mtu` is the NIC's, and the size of the largest packet that is tried. Blocks until the answers
// are there or have timed out. Never throws.
PathMtu probe_path_mtu(const std::string& nic, std::size_t mtu, const Address& host);

}  // namespace interneuron::io
