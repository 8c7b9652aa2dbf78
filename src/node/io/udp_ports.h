// The UDP ports that this process has bound, for the filter of the packet capture: whoever opens a
// socket notes its port. Ports are never taken back, because one that was ours may still get an
// answer. Thread-safe; the list lives as long as the process.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace interneuron::io {

void note_udp_port(std::uint16_t port);

// Calls `listener` now and whenever a port is added, on the thread that adds it and before its
// socket is used, with all ports, the newest last. One listener at a time; an empty one ends it.
using PortListener = std::function<void(const std::vector<std::uint16_t>&)>;
void listen_to_udp_ports(PortListener listener);

}  // namespace interneuron::io
