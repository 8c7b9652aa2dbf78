// Judges the facts of a host on which several network cards (NICs) are used at once: what is right,
// what is wrong, and the commands that mend it. docs/links.md, "The set-up: interneuron doctor",
// lists the checks. Pure; thread-safe; no errors: a fact that could not be read gives kNotChecked.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "app/doctor/measurements.h"
#include "node/monitor/host_facts.h"

namespace interneuron::doctor {

// The longest time between two packets of an idle link, in seconds (docs/constants.md, "Silence and
// address translation"). An address translation must keep a mapping for twice that, so that one
// packet may be lost.
inline constexpr int kKeepAliveSeconds = 15;

enum class Verdict : std::uint8_t {
  kOk,
  // It works, but not as well as it could.
  kWarning,
  // Packets will be lost, or a link cannot be used.
  kProblem,
  // `found` says why it was not checked, or what the check needs.
  kNotChecked,
};
// "ok", "warning", "problem" or "not checked".
std::string_view to_string(Verdict verdict);

struct Finding {
  // The name of the check, for example "rp_filter"; scripts may rely on it.
  std::string check;
  // The name of a NIC, or "host".
  std::string subject;
  Verdict verdict{};
  // One line.
  std::string found;
  // Commands that mend it, to be run in this order as root; empty: none is known.
  std::vector<std::string> fix;
};

// The findings of each NIC, then those of the host. Loopback is left out unless the target is
// there.
std::vector<Finding> judge(const io::HostFacts& facts);
// Appends the findings of one NIC, as judge() does for each that can be used.
void judge_nic(const io::HostFacts& host, const io::NicHostFacts& nic,
               std::vector<Finding>& findings);
// Judges how large packets may be on the path to the peer.
Finding judge_path(const PathMtu& path, std::size_t nic_mtu);
// Judges how long silent flows stayed open (`doctor --nat-timeout`).
Finding judge_nat(const NatTimeout& measured);

// Whether the NIC can be used; judge() checks only such NICs in detail.
bool is_usable(const io::HostFacts& facts, const io::NicHostFacts& nic);
// Whether the target is routed through the NIC, for any socket or for one bound to an address.
bool is_routed(const io::NicHostFacts& nic);
// The network of an address, "192.168.8.0/24"; and whether two addresses' networks overlap.
std::string subnet_text(const io::SourceFacts& source);
bool overlap(const io::SourceFacts& a, const io::SourceFacts& b);

}  // namespace interneuron::doctor
