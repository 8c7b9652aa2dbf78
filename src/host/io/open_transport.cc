#include "host/io/open_transport.h"

#include "host/io/ring_transport.h"
#include "host/io/udp_transport.h"
#include "host/io/xdp_transport.h"

namespace interneuron::io {

namespace {

template <class Kind>
OpenTransport open_as(const UdpOptions& options) {
  auto transport = std::make_unique<Kind>(options);
  OpenTransport out;
  out.warnings = transport->warnings();
  out.transport = std::move(transport);
  return out;
}

}  // namespace

OpenTransport open_transport(TransportKind kind, const UdpOptions& options) {
  switch (kind) {
    case TransportKind::kRing:
      return open_as<RingTransport>(options);
    case TransportKind::kXdp:
      return open_as<XdpTransport>(options);
    case TransportKind::kUdp:
      break;
  }
  return open_as<UdpTransport>(options);
}

void require_privilege(TransportKind kind) {
  if (kind != TransportKind::kUdp) PacketRing::require_privilege();
  if (kind == TransportKind::kXdp) XdpProgram::require_privilege();
}

}  // namespace interneuron::io
