#include "node/io/open_transport.h"

#include <algorithm>
#include <array>
#include <cerrno>

#include "node/io/parts.h"

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

// The part that has this kind of transport; nullptr: no part is needed. Throws IoError where it is
// needed and not linked.
const TransportPart* part_of(TransportKind kind) {
  const TransportPart* part = nullptr;
  switch (kind) {
    case TransportKind::kUdp:
      return nullptr;
    case TransportKind::kRing:
      part = ring_part();
      break;
    case TransportKind::kXdp:
      part = xdp_part();
      break;
  }
  if (part != nullptr) return part;
  const std::string name = "interneuron::" + std::string(to_string(kind));
  throw IoError("this program was built without " + name + ": link it, or take the transport udp",
                EOPNOTSUPP);
}

}  // namespace

OpenTransport open_transport(TransportKind kind, const UdpOptions& options) {
  const TransportPart* part = part_of(kind);
  return part != nullptr ? part->open(options) : open_as<UdpTransport>(options);
}

void require_privilege(TransportKind kind) {
  if (const TransportPart* part = part_of(kind)) part->require_privilege();
}

}  // namespace io

}  // namespace interneuron
