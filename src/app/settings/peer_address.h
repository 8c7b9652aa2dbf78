// HOST[:PORT] of a peer, as every command that asks for one takes it.
#pragma once

#include <cstdint>
#include <string>

#include "interneuron/transport.h"

namespace interneuron::settings {

// The port of `interneuron road`.
inline constexpr std::uint16_t kDefaultPort = 47000;

// 192.0.2.7, 192.0.2.7:47000, 2001:db8::7, [2001:db8::7], [2001:db8::7]:47000, or a name that the
// host's resolver knows (its first address), with or without a port. Throws Failure (1 unknown
// host, 2 malformed) naming `option`.
Address resolve_peer(const std::string& text, const std::string& option = "--peer",
                     std::uint16_t default_port = kDefaultPort);

}  // namespace interneuron::settings
