#include "node/io/open_transport.h"

#include <algorithm>
#include <array>

#include "node/io/ring_transport.h"
#include "node/io/udp_transport.h"
#include "node/io/xdp_transport.h"

namespace interneuron {

namespace {

// By TransportKind.
constexpr std::array<std::string_view, 3> kNames{"udp", "ring", "xdp"};

}  // namespace

std::string_view to_string(TransportKind kind) { return kNames[static_cast<std::size_t>(kind)]; }

std::optional<TransportKind> parse_transport_kind(std::string_view name) {
  const auto it = std::ranges::find(kNames, name);
  if (it == kNames.end()) return std::nullopt;
  return static_cast<TransportKind>(it - kNames.begin());
}

namespace io {

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
  if (kind == TransportKind::kRing) PacketRing::require_privilege();
  if (kind == TransportKind::kXdp) {
    XdpProgram::require_privilege();
    XdpSocket::require_memory();
  }
}

}  // namespace io

}  // namespace interneuron
