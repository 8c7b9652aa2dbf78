#include "app/doctor/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "interneuron/sizes.h"
#include "node/io/udp_socket.h"

namespace interneuron::doctor {
namespace {

using io::HostFacts;
using io::NicHostFacts;

class HostJudge {
 public:
  HostJudge(const HostFacts& facts, std::vector<Finding>& findings)
      : f_(facts), findings_(findings) {}

  void all() {
    cards();
    buffer("receive_buffer", "net.core.rmem_max", f_.rmem_max, io::kReceiveBufferBytes);
    buffer("send_buffer", "net.core.wmem_max", f_.wmem_max, io::kSendBufferBytes);
    conntrack();
    pmtu_discovery();
    option("segmentation_offload", "UDP_SEGMENT", f_.segmentation_error,
           "many datagrams leave in one call",
           "each datagram is a call, which costs processor time");
    option("receive_offload", "UDP_GRO", f_.gro_error, "many datagrams arrive in one call",
           "each datagram is a call, which costs processor time");
    option("timestamping", "SO_TIMESTAMPING", f_.timestamping_error, "packets are stamped",
           "round trips include the time in this host's queues");
    option("error_queue", "IP_RECVERR", f_.error_queue_error, "errors of routers are told",
           "an unreachable peer is noticed by its silence only");
    option("drop_count", "SO_RXQ_OVFL", f_.drop_count_error,
           "own drops are told from the network's", "own drops count as loss of the network");
    option("priority", "SO_PRIORITY, IP_TOS", f_.priority_error, "packets may be marked as urgent",
           "packets cannot be marked as urgent");
    option("send_time", "SO_TXTIME", f_.txtime_error, "the kernel takes send times",
           "not needed: packets are paced by the program");
  }

 private:
  void add(const char* check, Verdict verdict, std::string found,
           std::vector<std::string> fix = {}) {
    findings_.push_back({check, "host", verdict, std::move(found), std::move(fix)});
  }

  void cards() {
    std::string names;
    int usable = 0;
    int routed = 0;
    for (const NicHostFacts& nic : f_.nics) {
      if (!is_usable(f_, nic)) continue;
      ++usable;
      if (!is_routed(nic)) continue;
      ++routed;
      names += (names.empty() ? "" : ", ") + nic.nic.name;
    }
    if (usable == 0) {
      add("cards", Verdict::kProblem, "no network card is up and has an address",
          {"ip -brief address"});
    } else if (routed < 2 && usable > 1) {
      add("cards", Verdict::kWarning,
          fmt::format("{} of {} cards can be used: a second default route with a higher metric "
                      "lets the others be used too (see route)",
                      routed, usable));
    } else {
      add("cards", Verdict::kOk,
          fmt::format("{} of {} cards can be used: {}", routed, usable,
                      names.empty() ? "none" : names));
    }
  }

  void buffer(const char* check, const char* key, std::optional<std::size_t> value,
              std::size_t wanted) {
    if (!value) {
      add(check, Verdict::kNotChecked,
          std::string(key) + " cannot be read in this network namespace");
    } else if (*value < wanted) {
      add(check, Verdict::kWarning,
          fmt::format("{} = {}, less than the {} bytes that a socket asks for", key, *value,
                      wanted),
          {fmt::format("sysctl -w {}={}", key, wanted)});
    } else {
      add(check, Verdict::kOk, fmt::format("{} = {} bytes", key, *value));
    }
  }

  void conntrack() {
    if (!f_.conntrack_udp_s) {
      add("conntrack", Verdict::kOk, "this host does not track connections");
      return;
    }
    const int first = *f_.conntrack_udp_s;
    const int stream = f_.conntrack_udp_stream_s.value_or(first);
    const std::string found =
        fmt::format("UDP flows are forgotten after {} s, {} s with answers", first, stream);
    if (std::min(first, stream) > 2 * kKeepAliveSeconds - 1) {
      add("conntrack", Verdict::kOk, found);
      return;
    }
    add("conntrack", Verdict::kWarning,
        found + fmt::format("; idle links send every {} s", kKeepAliveSeconds),
        {fmt::format("sysctl -w net.netfilter.nf_conntrack_udp_timeout={}", 2 * kKeepAliveSeconds),
         "sysctl -w net.netfilter.nf_conntrack_udp_timeout_stream=120"});
  }

  void pmtu_discovery() {
    if (f_.discover_error != 0) {
      add("pmtu_discovery", Verdict::kProblem,
          fmt::format("IP_MTU_DISCOVER: {}: datagrams may be fragmented and lost",
                      std::strerror(f_.discover_error)));
    } else if (f_.no_pmtu_disc.value_or(0) != 0) {
      add("pmtu_discovery", Verdict::kWarning,
          fmt::format("net.ipv4.ip_no_pmtu_disc = {}: the system's own traffic is fragmented",
                      *f_.no_pmtu_disc),
          {"sysctl -w net.ipv4.ip_no_pmtu_disc=0"});
    } else {
      add("pmtu_discovery", Verdict::kOk, "datagrams are never fragmented");
    }
  }

  // What a socket may be asked for. None is needed; without it something is slower or blinder.
  void option(const char* check, const char* name, int error, const char* with,
              const char* without) {
    if (error == 0) {
      add(check, Verdict::kOk, fmt::format("{}: {}", name, with));
    } else {
      const bool harmless = std::string_view(without).starts_with("not needed");
      add(check, harmless ? Verdict::kOk : Verdict::kWarning,
          fmt::format("{}: {}: {}", name, std::strerror(error), without));
    }
  }

  const HostFacts& f_;
  std::vector<Finding>& findings_;
};

}  // namespace

std::string_view to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::kOk:
      return "ok";
    case Verdict::kWarning:
      return "warning";
    case Verdict::kProblem:
      return "problem";
    case Verdict::kNotChecked:
      return "not checked";
  }
  return "?";
}

std::vector<Finding> judge(const HostFacts& facts) {
  std::vector<Finding> findings;
  for (const NicHostFacts& nic : facts.nics) {
    if (is_usable(facts, nic)) {
      judge_nic(facts, nic, findings);
      continue;
    }
    if (nic.nic.kind == "loopback") continue;
    const bool down = !nic.nic.admin_up;
    Finding finding{"state", nic.nic.name, Verdict::kNotChecked, "", {}};
    finding.found = fmt::format("{}{}: the rest is not checked", to_string(nic.state),
                                nic.reason.empty() ? "" : " (" + nic.reason + ")");
    if (down) finding.fix = {fmt::format("ip link set dev {} up", nic.nic.name)};
    findings.push_back(std::move(finding));
  }
  HostJudge(facts, findings).all();
  return findings;
}

Finding judge_path(const PathMtu& path, std::size_t nic_mtu) {
  Finding finding{"path_mtu", path.nic, Verdict::kNotChecked, "", {}};
  if (path.error != 0) {
    finding.found = fmt::format("needs to send echo requests: {}", std::strerror(path.error));
    if (path.error == EACCES || path.error == EPERM) {
      finding.fix = {"sysctl -w net.ipv4.ping_group_range=\"0 2147483647\""};
    }
    return finding;
  }
  std::size_t passes = 0;
  std::size_t fails = 0;
  for (const PathMtu::Probe& probe : path.probes) {
    if (probe.answered) {
      passes = std::max(passes, probe.bytes);
    } else {
      fails = probe.bytes;
    }
  }
  if (passes == 0) {
    finding.found = "the peer does not answer echo requests of any size";
    return finding;
  }
  const std::size_t largest = kMaxPacketBytes;
  const std::size_t used = std::min(largest, nic_mtu);
  if (fails == 0 || passes >= used) {
    finding.verdict = Verdict::kOk;
    finding.found = fmt::format("packets of {} bytes pass", passes);
    return finding;
  }
  finding.verdict = Verdict::kProblem;
  finding.found = fmt::format("packets of {} bytes pass, of {} do not{}", passes, fails,
                              path.told ? fmt::format(": a router says {}", *path.told)
                                        : ", and nobody says so (a black hole)");
  finding.fix = {fmt::format("ip link set dev {} mtu {}", path.nic, path.told.value_or(passes))};
  return finding;
}

}  // namespace interneuron::doctor
