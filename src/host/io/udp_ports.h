// The UDP ports that this process has bound, for the packet capture: whoever opens a socket notes
// its port. They are not taken back: a port that was ours may still get an answer. Thread-safe.
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
