// From facts of a host to findings: what is as it must be where several network cards (NICs) are
// used at once, what is not, and the command that changes it. docs/links.md, "The set-up:
// interneuron doctor", lists the checks. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "host/io/host_facts.h"
#include "host/io/path_mtu.h"

namespace interneuron::cli::doctor {

// A link that carries nothing else sends a sign of life this often (docs/constants.md, "Silence and
// address translation"); translations must live longer, with a sign of life lost.
inline constexpr int kKeepAliveSeconds = 15;

enum class Verdict : std::uint8_t {
  kOk,
  kWarning,     // works, but not as well as it could
  kProblem,     // packets will be lost, or a link cannot be used
  kNotChecked,  // `found` says why, or what it needs
};
std::string_view to_string(Verdict verdict);  // "ok", "warning", "problem", "not checked"

struct Finding {
  std::string check;    // "rp_filter"; stable
  std::string subject;  // a NIC, or "host"
  Verdict verdict{};
  std::string found;             // one line
  std::vector<std::string> fix;  // commands, to be run in this order as root; empty: none is known
};

// NIC by NIC, then the host's. Loopback is left out unless the target is there.
std::vector<Finding> judge(const io::HostFacts& facts);

// What a path to the peer was found to carry; see io::probe_path_mtu().
Finding judge_path(const io::PathMtu& path, std::size_t nic_mtu);

// NICs that can be used: those that judge() looks at closely.
bool is_usable(const io::HostFacts& facts, const io::NicHostFacts& nic);

// The target is routed through it, for any socket or for one bound to an address.
bool is_routed(const io::NicHostFacts& nic);

}  // namespace interneuron::cli::doctor
