#include "netns/wiring/wiring.h"

#include <sys/socket.h>
#include <sys/statvfs.h>

#include "netns/state/check.h"
#include "netns/wiring/nat.h"
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

std::string port(char kind, std::size_t host, std::size_t network) {
  return kind + std::to_string(host + 1) + "-" + std::to_string(network + 1);
}

// False where /proc/sys is read-only (containers): the core could not be told to route IPv6.
bool ipv6_can_be_routed() {
  struct statvfs settings {};
  return ::statvfs("/proc/sys/net/ipv6/conf/all/forwarding", &settings) == 0 &&
         (settings.f_flag & ST_RDONLY) == 0;
}

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

}  // namespace

std::string vehicle_port(std::size_t vehicle, std::size_t network) {
  return port('v', vehicle, network);
}
std::string core_port(std::size_t vehicle, std::size_t network) {
  return port('c', vehicle, network);
}
std::string gateway_nic(std::size_t vehicle, std::size_t network) {
  return port('g', vehicle, network);
}
std::string road_nic(std::size_t road, std::size_t network) { return port('r', road, network); }

std::string road_address(std::size_t road, std::size_t network, int family) {
  return Network(network, family).road(road);
}

std::vector<TestbedLink> plan_links(const TestbedOptions& options) {
  const bool ipv6 = ipv6_can_be_routed();
  std::vector<TestbedLink> out;
  for (std::size_t v = 0; v < options.vehicles; ++v) {
    for (std::size_t n = 0; n < options.scenario.links.size(); ++n) {
      const emu::ScenarioLink& spec = options.scenario.links[n];
      const Network four(n, AF_INET);
      const Network six(n, AF_INET6);
      TestbedLink link;
      link.name = spec.name;
      link.vehicle = v;
      link.profile = spec.profile.name;
      link.nic = "if" + spec.name;
      link.vehicle_address = four.vehicle(v);
      link.gateway = four.gateway(v);
      link.road_address = four.road(0);
      if (ipv6) {
        link.vehicle_address6 = six.vehicle(v);
        link.gateway6 = six.gateway(v);
        link.road_address6 = six.road(0);
      }
      out.push_back(std::move(link));
    }
  }
  return out;
}

void wire(const State& state, const TestbedOptions& options, const Namespaces& namespaces) {
  Wiring wiring(state, options, namespaces);
  wiring.make_pairs();
  wiring.set_up_all();
  if (!options.nat) return;
  const NetworkNamespaceScope scope(namespaces.core.get(), namespaces.air.get());
  set_up_nat(options.scenario.links.size());
}

}  // namespace interneuron::netns
