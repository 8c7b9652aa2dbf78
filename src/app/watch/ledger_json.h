// What a program keeps of its peers (PeerLedger) as JSON and back; docs/schema/links.json is the
// authority. Pure.
#pragma once

#include <vector>

#include "app/watch/json.h"

namespace interneuron::watch {

// "loop_stall_ms" and "peers", each with what it holds, how often each limit has struck it and what
// is computed for it.
Json ledgers_json(Duration loop_stall, const std::vector<LivePeer>& peers);

// What ledgers_json() has written. The text comes from another process: an exception of the JSON
// library where it is anything else.
Duration loop_stall_of(const Json& json);
std::vector<LivePeer> peers_of(const Json& json);

}  // namespace interneuron::watch
