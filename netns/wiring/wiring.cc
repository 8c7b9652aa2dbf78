#include "netns/wiring/wiring.h"

#include <nftables/libnftables.h>
#include <sys/socket.h>

#include <memory>

#include "netns/state/error.h"
#include "netns/wiring/nics.h"

namespace interneuron::netns {

namespace {

// The first numbers of the NICs in the core and in `air`. Those of vehicles and roadside units
// begin with 2, so that the two ends of a pair never have the same number (NicEnd::index).
constexpr int kCoreIndices = 100;
constexpr int kAirIndices = 10'000;

// How many carriers may be new before wire() waits for them. The kernel processes a hundred at
// once and the next hundred a second later (MAX_DO_DEV_PER_LOOP of net/core/link_watch.c).
constexpr std::size_t kCarriersAtOnce = 64;

// One call of wire(). Refers to its arguments.
class Wiring {
 public:
  Wiring(const State& state, const TestbedOptions& options, const Namespaces& namespaces)
      : options_(options),
        namespaces_(namespaces),
        hosts_(plan_hosts(state, options)),
        emulated_(state.backend == Backend::kEmulator),
        ipv6_(!state.links.front().vehicle_address6.empty()) {}

  void make_pairs();
  void set_up_all();

 private:
  NicEnd end_of(const HostPlan& host, std::size_t nic) const;
  void make_link(const NicEnd& vehicle, const NicEnd& gateway, std::size_t v, std::size_t n);
  void set_up_host(const HostPlan& host);
  void set_up_ports(std::size_t v);
  void await(const HostPlan& host);

  const TestbedOptions& options_;
  const Namespaces& namespaces_;
  std::vector<HostPlan> hosts_;
  bool emulated_;
  bool ipv6_;
  int next_air_index_ = kAirIndices;
  // Acts on the namespace `air`.
  netlink::Socket socket_ = netlink::open_socket();
};

// NIC number `nic` of a host as an end of a veth pair. Only hosts that do not forward have
// multicast (see describe() of nics.cc).
NicEnd Wiring::end_of(const HostPlan& host, std::size_t nic) const {
  const NicPlan& plan = host.nics[nic];
  const int base = host.host == kCore ? kCoreIndices : 2;
  return {plan.nic, plan.mac, network_of(namespaces_, host.host), !plan.forwards,
          base + static_cast<int>(nic)};
}

// Makes the one pair (netem) or the two pairs (emulator) of the link of vehicle v on network n.
void Wiring::make_link(const NicEnd& vehicle, const NicEnd& gateway, std::size_t v, std::size_t n) {
  if (!emulated_) {
    make_pair(socket_.get(), vehicle, gateway);
    return;
  }
  const int air = namespaces_.air.get();
  make_pair(socket_.get(), {vehicle_port(v, n), "", air, false, next_air_index_++}, vehicle);
  make_pair(socket_.get(), {core_port(v, n), "", air, false, next_air_index_++}, gateway);
}

// Makes the veth pairs of all hosts. The plan lists the core's NICs in the order of the hosts to
// which they lead.
void Wiring::make_pairs() {
  const HostPlan& core = hosts_.back();
  const std::size_t networks = options_.scenario.links.size();
  for (std::size_t host = 0; host + 1 < hosts_.size(); ++host) {
    for (std::size_t n = 0; n < networks; ++n) {
      const NicEnd end = end_of(hosts_[host], n);
      const NicEnd opposite = end_of(core, host * networks + n);
      if (hosts_[host].host.kind == Host::Kind::kVehicle) {
        make_link(end, opposite, host, n);
      } else {
        make_pair(socket_.get(), end, opposite);
      }
    }
  }
}

// Sets up all NICs of a host, from within its namespace.
void Wiring::set_up_host(const HostPlan& host) {
  const NetworkNamespaceScope scope(network_of(namespaces_, host.host), namespaces_.air.get());
  const netlink::Socket socket = netlink::open_socket();
  set_up(socket.get(), "lo");
  if (host.host == kCore) enable_forwarding(ipv6_);
  for (const NicPlan& nic : host.nics) set_up(socket.get(), nic);
}

// Sets up the emulator's NICs of vehicle v.
void Wiring::set_up_ports(std::size_t v) {
  for (std::size_t n = 0; n < options_.scenario.links.size(); ++n) {
    set_up(socket_.get(), vehicle_port(v, n));
    set_up(socket_.get(), core_port(v, n));
  }
}

void Wiring::await(const HostPlan& host) {
  const NetworkNamespaceScope scope(network_of(namespaces_, host.host), namespaces_.air.get());
  await_operational(netlink::open_socket().get(), host.nics);
}

// Sets up the core's NICs first, which get no carrier yet, then those of the other hosts. Waits
// whenever kCarriersAtOnce may have come up.
void Wiring::set_up_all() {
  set_up_host(hosts_.back());
  std::size_t carriers = 0;
  for (std::size_t host = 0; host + 1 < hosts_.size(); ++host) {
    set_up_host(hosts_[host]);
    if (emulated_ && hosts_[host].host.kind == Host::Kind::kVehicle) set_up_ports(host);
    // Two pairs per link at most.
    carriers += 4 * options_.scenario.links.size();
    if (carriers < kCarriersAtOnce) continue;
    await(hosts_[host]);
    carriers = 0;
  }
  for (const HostPlan& host : hosts_) await(host);
}

struct ContextDeleter {
  void operator()(nft_ctx* context) const { ::nft_ctx_free(context); }
};

// Patterns of the core's NICs: those towards roadside units (road_nic()) and towards vehicles
// (gateway_nic()).
constexpr const char* kToRoads = "\"r*\"";
constexpr const char* kToVehicles = "\"g*\"";

std::string rules(std::size_t networks) {
  std::string text =
      "table ip interneuron {\n chain leaving {\n"
      "  type nat hook postrouting priority 100;\n";
  for (std::size_t n = 0; n < networks; ++n) {
    const Network net(n, AF_INET);
    // The sender's network decides, not the NIC by which the packet leaves: a modem that sends to
    // an address of another network does so through its own carrier.
    text += std::string("  oifname ") + kToRoads + " ip saddr " + net.everything() + " snat to " +
            net.core() + "\n";
  }
  text += std::string(" }\n}\ntable inet interneuron {\n chain passing {\n") +
          "  type filter hook forward priority 0;\n  iifname " + kToRoads + " oifname " +
          kToVehicles + " ct state != { established, related } drop\n }\n}\n";
  return text;
}

// The first line of an nftables message, without the label "Error: ".
std::string first_line(std::string text) {
  text = text.substr(0, text.find('\n'));
  const std::size_t label = text.find("Error: ");
  return label == std::string::npos ? text : text.substr(label + 7);
}

// Sets up address translation and a stateful firewall in the current network namespace, which must
// be the core's, as a carrier's gateway has them, by nftables. Packets that vehicles'
// modems on network n send to roadside units leave with the core's own IPv4 address on that
// network; IPv6 addresses are not translated. A roadside unit cannot open a flow to a vehicle, by
// IPv4 or IPv6; vehicles reach one another as before. The kernel forgets a mapping that is idle for
// net.netfilter.nf_conntrack_udp_timeout (30 s), or for ..._udp_timeout_stream (120 s) once there
// has been traffic both ways; both can be set in the core.
void set_up_nat(std::size_t networks) {
  const std::unique_ptr<nft_ctx, ContextDeleter> context(::nft_ctx_new(NFT_CTX_DEFAULT));
  if (!context) throw TestbedError(1, "cannot set up address translation: out of memory");
  ::nft_ctx_buffer_output(context.get());
  ::nft_ctx_buffer_error(context.get());
  if (::nft_run_cmd_from_buffer(context.get(), rules(networks).c_str()) == 0) return;
  throw TestbedError(1, "cannot set up address translation: " +
                            first_line(::nft_ctx_get_error_buffer(context.get())) +
                            "; the kernel needs nftables with NAT (`modprobe -a nft_ct nft_nat` as "
                            "root loads them), or leave NAT out");
}

}  // namespace

void wire(const State& state, const TestbedOptions& options, const Namespaces& namespaces) {
  Wiring wiring(state, options, namespaces);
  wiring.make_pairs();
  wiring.set_up_all();
  if (!options.nat) return;
  const NetworkNamespaceScope scope(namespaces.core.get(), namespaces.air.get());
  set_up_nat(options.scenario.links.size());
}

}  // namespace interneuron::netns
