// Which network cards (NICs) an operator means.
//
//   wwan0                    a name
//   wwan*, e?h[0-3]          a glob of names (man 7 glob), which matches no loopback card
//   kind:wwan                a kind of NIC (io::Nic::kind)
//   mac:02:00:00:00:00:01    a hardware address, in either case
//
// Pure values, no system calls. Thread-safe.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "node/io/nic.h"

namespace interneuron::io {

// Whether the pattern is a rule (a glob, a kind, a hardware address) and not one NIC's name. Only
// rules may match nothing for now, and NICs that come later.
bool is_nic_rule(std::string_view pattern);

// What is wrong with a pattern, one line; empty: nothing.
std::string nic_pattern_error(std::string_view pattern);

bool matches(std::string_view pattern, const Nic& nic);

// "no network card matches wwan*; there are lo (loopback), eth0 (ethernet)"; for a plain name "no
// network card named eth9; there are lo, eth0".
std::string no_match_text(std::string_view pattern, std::span<const Nic> nics);

}  // namespace interneuron::io
