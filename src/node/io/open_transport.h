// Opens a NIC's transport of the kind that the user asks for.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "interneuron/node_options.h"
#include "interneuron/transport.h"
#include "node/io/udp_socket.h"

namespace interneuron::io {

struct OpenTransport {
  std::unique_ptr<Transport> transport;
  // What could not be had as asked and what the user should know, one line each.
  std::vector<std::string> warnings;
};

// Throws IoError with the remedy, also when the kind is a part of the library that this program was
// linked without.
OpenTransport open_transport(TransportKind kind, const UdpOptions& options);

// Throws IoError (EPERM) with the remedy when this process may not open transports of this kind on
// any NIC, or was linked without them.
void require_privilege(TransportKind kind);

}  // namespace interneuron::io
