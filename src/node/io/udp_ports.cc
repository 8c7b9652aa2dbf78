#include "node/io/udp_ports.h"

#include <algorithm>
#include <mutex>

namespace interneuron::io {
namespace {

// Only the newest ports are kept, because more do not fit into one packet filter. A NIC that comes
// and goes takes a new port each time.
constexpr std::size_t kMaxPorts = 128;

// The ports of the process; the mutex guards the rest and is held while the listener is called.
struct Registry {
  std::mutex mutex;
  std::vector<std::uint16_t> ports;
  PortListener listener;
};

Registry& registry() {
  static Registry one;
  return one;
}

}  // namespace

void note_udp_port(std::uint16_t port) {
  Registry& r = registry();
  const std::lock_guard lock(r.mutex);
  if (std::ranges::find(r.ports, port) != r.ports.end()) return;
  r.ports.push_back(port);
  if (r.ports.size() > kMaxPorts) r.ports.erase(r.ports.begin());
  if (r.listener) r.listener(r.ports);
}

void listen_to_udp_ports(PortListener listener) {
  Registry& r = registry();
  const std::lock_guard lock(r.mutex);
  r.listener = std::move(listener);
  if (r.listener) r.listener(r.ports);
}

}  // namespace interneuron::io
