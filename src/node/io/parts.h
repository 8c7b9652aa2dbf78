// The parts of the library that a program may do without (docs/install.md, "From another
// project"): what this folder asks them for, where they are linked. A part defines its constant
// below; whoever links the part makes the linker take it. Where it is not linked, what asks for it
// finds nothing.
#pragma once

#include <memory>
#include <vector>

#include "node/io/nic.h"
#include "node/io/nic_monitor.h"
#include "node/io/open_transport.h"
#include "node/io/udp_socket.h"

namespace interneuron::io {

struct MonitorPart {
  std::unique_ptr<NicMonitor> (*open)();
  std::vector<Nic> (*list_nics)();
};

// A kind of transport. Both throw IoError.
struct TransportPart {
  OpenTransport (*open)(const UdpOptions& options);
  // When this process may not open any.
  void (*require_privilege)();
};

// nullptr: not linked.
const MonitorPart* monitor_part();
const TransportPart* ring_part();
const TransportPart* xdp_part();

// How a TransportPart opens its kind.
template <class Kind>
OpenTransport open_as(const UdpOptions& options) {
  auto transport = std::make_unique<Kind>(options);
  OpenTransport out;
  out.warnings = transport->warnings();
  out.transport = std::move(transport);
  return out;
}

}  // namespace interneuron::io

// Their names are C's, so that cmake/modules.cmake can tell them to the linker.
extern "C" {
extern const interneuron::io::MonitorPart interneuron_monitor_part;
extern const interneuron::io::TransportPart interneuron_ring_part;
extern const interneuron::io::TransportPart interneuron_xdp_part;
}
