// What `interneuron doctor` measures with packets of its own: how large one may be on the way to a
// peer, and how long address translations keep silent flows open. Takes the calling thread.
// Anybody can forge the answers, and the routers' errors (ICMP); the results are shown to people
// and decide nothing.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/probe/silence.h"
#include "interneuron/transport.h"
#include "node/monitor/host_facts.h"

namespace interneuron::doctor {

// How large packets may be on the way to a host through one network card (NIC).
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

// Sends echo requests (ping) of rising size with "don't fragment", some ten packets, and waits for
// their answers. `mtu` is the NIC's, and the size of the largest packet that is tried. Blocks until
// the answers are there or have timed out. Never throws.
PathMtu probe_path_mtu(const std::string& nic, std::size_t mtu, const Address& host);

struct NatTimeout {
  std::string nic;
  // The longest silence that was to be tried; 0: none.
  probe::Silence limit{};
  probe::SilenceResult flows;
  // One line that says why not everything was tried; empty: everything was.
  std::string cut_short;
};

// Runs a probe::SilenceTest, with a socket per flow, for each usable NIC through which the target
// of `facts` is routed, all at the same time. Takes some seconds more than `limit` and says on
// stderr how long; SIGINT, SIGTERM and SIGHUP end it earlier. A NIC whose sockets cannot be opened,
// or that goes away, is reported as cut short. Throws IoError only when the NICs cannot be watched.
std::vector<NatTimeout> measure_nat_timeouts(const io::HostFacts& facts, probe::Silence limit);

}  // namespace interneuron::doctor
