#include "app/doctor/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "app/process/sibling.h"
#include "interneuron/sizes.h"
#include "node/io/address.h"

namespace interneuron::doctor {
namespace {

using io::HostFacts;
using io::NicHostFacts;
using io::SourceFacts;

// Values of rp_filter (Documentation/networking/ip-sysctl of the kernel).
constexpr int kStrict = 1;
constexpr int kLoose = 2;
// RFC 8200 section 5.
constexpr std::size_t kSmallestIpv6Mtu = 1280;
// Carries our largest datagram over IPv4.
constexpr std::size_t kFullMtu = kMaxDatagramBytes + kIpv4UdpBytes;
// To this the NIC's index is added for the table and metric of a proposed route, so that no two
// NICs share one. No measurement is behind this value: it only has to be apart from the numbers of
// the system's own tools (table 254, metrics 100 to 700 of NetworkManager).
constexpr int kFirstTable = 1000;
constexpr int kFirstMetric = 1000;

int table_of(const NicHostFacts& nic) { return kFirstTable + nic.nic.index; }
int metric_of(const NicHostFacts& nic) { return kFirstMetric + nic.nic.index; }

// A dot in a NIC's name (eth0.7) would separate parts of the key.
std::string sysctl_name(std::string nic) {
  std::ranges::replace(nic, '.', '/');
  return nic;
}

std::size_t host_offset(const Address& a) { return is_ipv6(a) ? 8 : 4; }  // of sockaddr_in(6)
int bits_of(const Address& a) { return is_ipv6(a) ? 128 : 32; }

int bit(const Address& a, int index) {
  const auto byte = a.raw[host_offset(a) + static_cast<std::size_t>(index / 8)];
  return std::to_integer<int>(byte) >> (7 - index % 8) & 1;
}

Address network_of(const SourceFacts& source) {
  Address network = source.address;
  for (int i = source.prefix; i < bits_of(network); ++i) {
    auto& byte = network.raw[host_offset(network) + static_cast<std::size_t>(i / 8)];
    byte &= ~(std::byte{1} << (7 - i % 8));
  }
  return network;
}

// Addresses that can be seen from elsewhere.
std::vector<const SourceFacts*> global_sources(const NicHostFacts& nic) {
  std::vector<const SourceFacts*> sources;
  for (const SourceFacts& s : nic.sources) {
    if (!(is_ipv6(s.address) && is_link_local(s.address))) sources.push_back(&s);
  }
  return sources;
}

std::vector<const SourceFacts*> ipv4_sources(const NicHostFacts& nic) {
  auto sources = global_sources(nic);
  std::erase_if(sources, [](const SourceFacts* s) { return is_ipv6(s->address); });
  return sources;
}

// The first IPv4 address of a NIC whose network overlaps one of the other's; nullptr: none does.
const SourceFacts* shared_network(const NicHostFacts& nic, const NicHostFacts& other) {
  for (const SourceFacts* mine : ipv4_sources(nic)) {
    for (const SourceFacts* theirs : ipv4_sources(other)) {
      if (overlap(*mine, *theirs)) return mine;
    }
  }
  return nullptr;
}

// A NIC's gateway as commands and people are told of it.
struct Gateway {
  // "via 10.0.0.1 "; empty: none is needed.
  std::string via;
  // Says that the gateway is a guess; empty: it is known.
  std::string note;
};

// The gateway of a route in any table, else the first address of the subnet, which most routers
// use.
Gateway gateway_of(const NicHostFacts& nic) {
  const auto via = [](const Address& a) { return "via " + io::host_text(a) + " "; };
  if (nic.table_gateway) return {via(*nic.table_gateway), ""};
  if (!nic.nic.gateways.empty()) return {via(nic.nic.gateways.front()), ""};
  const auto sources = global_sources(nic);
  if (sources.empty() || sources.front()->prefix + 1 >= bits_of(sources.front()->address)) {
    // A point-to-point NIC needs no gateway.
    return {};
  }
  Address first = network_of(*sources.front());
  const std::size_t last = host_offset(first) + static_cast<std::size_t>(bits_of(first) / 8) - 1;
  first.raw[last] |= std::byte{1};
  if (io::host_text(first) == io::host_text(sources.front()->address)) {
    // The host itself has .1, so .2 is the guess.
    first.raw[last] ^= std::byte{3};
  }
  return {via(first), "; its gateway is not known, " + io::host_text(first) + " is a guess"};
}

// "ip -6" for commands about an IPv6 address.
std::string ip_command(bool ipv6) { return ipv6 ? "ip -6 " : "ip "; }

std::string default_route(const NicHostFacts& nic, bool ipv6, const std::string& where) {
  return ip_command(ipv6) + "route add default " + gateway_of(nic).via + "dev " + nic.nic.name +
         " " + where;
}

// For one NIC; each method is one check.
class NicJudge {
 public:
  NicJudge(const HostFacts& host, const NicHostFacts& nic, std::vector<Finding>& findings)
      : host_(host), nic_(nic), findings_(findings) {}

  void all() {
    bind();
    route();
    rp_filter();
    source_rules();
    several_addresses();
    same_subnet();
    mtu();
    ipv6();
    timestamps();
    pacing();
  }

 private:
  const std::string& name() const { return nic_.nic.name; }
  void add(const char* check, Verdict verdict, std::string found,
           std::vector<std::string> fix = {}) {
    findings_.push_back({check, name(), verdict, std::move(found), std::move(fix)});
  }
  std::string target() const {
    return host_.target_is_peer ? io::host_text(host_.target) : "the Internet";
  }

  void bind() {
    if (nic_.bind_error == 0) {
      add("bind_to_device", Verdict::kOk, "sockets may be bound to it");
      return;
    }
    // `vehicle` and `road` run in a program of their own.
    add("bind_to_device", Verdict::kProblem,
        fmt::format("SO_BINDTODEVICE: {}; Linux before 5.7 allows it to CAP_NET_RAW only",
                    std::strerror(nic_.bind_error)),
        {"setcap cap_net_raw+ep \"$(command -v interneuron)\"",
         fmt::format("setcap cap_net_raw+ep \"$(dirname \"$(command -v interneuron)\")/{}/"
                     "interneuron-offload\"",
                     process::kSiblings)});
  }

  void route();
  void rp_filter();
  void source_rules();
  void several_addresses();
  void same_subnet();
  void mtu();
  void ipv6();

  void timestamps() {
    if (nic_.send_timestamps) {
      add("timestamps", Verdict::kOk,
          nic_.hardware_timestamps ? "software and hardware stamps of packets that leave"
                                   : "software stamps of packets that leave");
    } else {
      add("timestamps", Verdict::kOk,
          "its driver stamps no packets that leave: time in its queue counts as round trip");
    }
  }
  void pacing() {
    add("pacing", Verdict::kOk,
        "qdisc " + (nic_.qdisc.empty() ? "unknown" : nic_.qdisc) +
            ": packets are paced by the program");
  }

  const HostFacts& host_;
  const NicHostFacts& nic_;
  std::vector<Finding>& findings_;
};

void NicJudge::route() {
  const auto sources = global_sources(nic_);
  if (nic_.routed) {
    const auto& gateways = nic_.nic.gateways;
    add("route", Verdict::kOk,
        target() + " is routed through it" +
            (gateways.empty() ? "" : ", gateway " + io::host_text(gateways.front())));
    return;
  }
  const auto by_rule =
      std::ranges::find_if(sources, [](const SourceFacts* s) { return s->routed; });
  if (by_rule != sources.end()) {
    add("route", Verdict::kOk,
        fmt::format("{} is routed through it from {}, by a rule", target(),
                    io::host_text((*by_rule)->address)));
    return;
  }
  const bool ipv6 = !sources.empty() && is_ipv6(sources.front()->address);
  add("route", Verdict::kProblem,
      fmt::format("no route to {} through it: packets would be sent to a neighbour that is not "
                  "there{}",
                  target(), gateway_of(nic_).note),
      {default_route(nic_, ipv6, fmt::format("metric {}", metric_of(nic_)))});
}

void NicJudge::rp_filter() {
  const auto sources = ipv4_sources(nic_);
  if (sources.empty()) return;
  if (!nic_.rp_filter || !host_.rp_filter_all) {
    add("rp_filter", Verdict::kNotChecked, "net.ipv4.conf.*.rp_filter cannot be read here");
    return;
  }
  const int effective = std::max(*nic_.rp_filter, *host_.rp_filter_all);
  const auto elsewhere =
      std::ranges::find_if(sources, [&](const SourceFacts* s) { return s->leaves_by != name(); });
  if (effective != kStrict) {
    add("rp_filter", Verdict::kOk,
        effective == kLoose ? "loose (2): replies are taken on any card" : "off (0)");
  } else if (elsewhere == sources.end()) {
    add("rp_filter", Verdict::kOk, "strict (1), and replies come in where packets leave");
  } else {
    const std::string& by = (*elsewhere)->leaves_by;
    add("rp_filter", Verdict::kProblem,
        fmt::format("strict (1), and {} from {} is routed {}: replies on this card are dropped",
                    target(), io::host_text((*elsewhere)->address),
                    by.empty() ? "nowhere" : "through " + by),
        {fmt::format("sysctl -w net.ipv4.conf.{}.rp_filter=2", sysctl_name(name()))});
  }
}

void NicJudge::source_rules() {
  std::vector<const SourceFacts*> wrong;
  for (const SourceFacts* s : global_sources(nic_)) {
    // An address of the other family than the target's was not asked for.
    const bool asked = s->routed || !s->leaves_by.empty() || !is_ipv6(s->address);
    if (asked && s->leaves_by != name()) wrong.push_back(s);
  }
  if (wrong.empty()) {
    add("source_rule", Verdict::kOk, "packets from its addresses leave through it");
    return;
  }
  std::vector<std::string> fix;
  for (const SourceFacts* s : wrong) {
    const bool ipv6 = is_ipv6(s->address);
    const std::string table = fmt::format("table {}", table_of(nic_));
    if (s == wrong.front()) fix.push_back(default_route(nic_, ipv6, table));
    fix.push_back(
        fmt::format("{}rule add from {} {}", ip_command(ipv6), io::host_text(s->address), table));
  }
  const std::string& by = wrong.front()->leaves_by;
  add("source_rule", Verdict::kWarning,
      fmt::format("packets from {} leave {} unless their socket is bound to {}{}",
                  io::host_text(wrong.front()->address), by.empty() ? "nowhere" : "through " + by,
                  name(), gateway_of(nic_).note),
      std::move(fix));
}

void NicJudge::several_addresses() {
  const auto sources = ipv4_sources(nic_);
  if (sources.size() < 2) return;
  std::string list;
  for (const SourceFacts* s : sources)
    list += (list.empty() ? "" : ", ") + io::host_text(s->address);
  add("several_addresses", Verdict::kWarning,
      fmt::format("{}: a roadside unit on it answers from the first only; name one with --address",
                  list));
}

void NicJudge::same_subnet() {
  for (const NicHostFacts& other : host_.nics) {
    if (&other == &nic_ || !is_usable(host_, other)) continue;
    const SourceFacts* mine = shared_network(nic_, other);
    if (mine == nullptr) continue;
    const int ignore = std::max(nic_.arp_ignore.value_or(0), host_.arp_ignore_all.value_or(0));
    const int announce =
        std::max(nic_.arp_announce.value_or(0), host_.arp_announce_all.value_or(0));
    const std::string both =
        fmt::format("the same network {} as on {}", subnet_text(*mine), other.nic.name);
    if (ignore >= 1 && announce >= 2) {
      add("same_subnet", Verdict::kOk, both + ", and each card answers ARP for itself only");
    } else {
      add("same_subnet", Verdict::kProblem,
          both + ": each card answers ARP for the other's address",
          {"sysctl -w net.ipv4.conf.all.arp_ignore=1",
           "sysctl -w net.ipv4.conf.all.arp_announce=2"});
    }
    return;
  }
}

void NicJudge::mtu() {
  const std::size_t mtu = nic_.nic.mtu;
  if (mtu < kSmallestIpv6Mtu) {
    add("mtu", Verdict::kProblem,
        fmt::format("{} bytes; datagrams of 1280 must pass, IPv6 needs that too", mtu),
        {fmt::format("ip link set dev {} mtu {}", name(), kSmallestIpv6Mtu)});
  } else if (nic_.route_mtu && *nic_.route_mtu < mtu && *nic_.route_mtu < kFullMtu) {
    add("mtu", Verdict::kWarning,
        fmt::format("{} bytes, but the kernel has learnt that the path carries {}", mtu,
                    *nic_.route_mtu),
        {fmt::format("ip link set dev {} mtu {}", name(),
                     std::max(kSmallestIpv6Mtu, *nic_.route_mtu))});
  } else {
    add("mtu", Verdict::kOk,
        fmt::format("{} bytes{}", mtu, mtu < kFullMtu ? ": datagrams are cut to it" : ""));
  }
}

void NicJudge::ipv6() {
  bool link_local = false;
  bool global = false;
  bool temporary = false;
  for (const SourceFacts& s : nic_.sources) {
    if (!is_ipv6(s.address)) continue;
    (is_link_local(s.address) ? link_local : global) = true;
    temporary |= s.temporary;
  }
  if (temporary) {
    add("ipv6", Verdict::kWarning,
        "temporary addresses: when they are replaced, the link is opened anew",
        {fmt::format("sysctl -w net.ipv6.conf.{}.use_tempaddr=0", sysctl_name(name()))});
  } else if (global) {
    add("ipv6", Verdict::kOk, "an address that can be routed");
  } else if (link_local) {
    add("ipv6", Verdict::kOk,
        fmt::format("link-local only: peers must be named with their zone, [fe80::1%{}]:47000",
                    name()));
  } else {
    add("ipv6", Verdict::kOk, "not used");
  }
}

}  // namespace

bool is_usable(const HostFacts& facts, const NicHostFacts& nic) {
  const bool loopback = nic.nic.kind == "loopback";
  if (loopback && !(facts.target_is_peer && is_loopback(facts.target))) return false;
  return nic.state == NicState::kReady || nic.state == NicState::kNoRoute;
}

bool is_routed(const NicHostFacts& nic) {
  return nic.routed || std::ranges::any_of(nic.sources, &io::SourceFacts::routed);
}

std::string subnet_text(const SourceFacts& source) {
  return fmt::format("{}/{}", io::host_text(network_of(source)), source.prefix);
}

bool overlap(const SourceFacts& a, const SourceFacts& b) {
  if (is_ipv6(a.address) != is_ipv6(b.address)) return false;
  const int shared = std::min(a.prefix, b.prefix);
  for (int i = 0; i < shared; ++i) {
    if (bit(a.address, i) != bit(b.address, i)) return false;
  }
  return true;
}

void judge_nic(const HostFacts& host, const NicHostFacts& nic, std::vector<Finding>& findings) {
  NicJudge(host, nic, findings).all();
}

}  // namespace interneuron::doctor
