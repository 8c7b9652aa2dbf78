#include "netns/wiring/nic_plan.h"

#include <sys/socket.h>
#include <sys/statvfs.h>

#include <array>
#include <cstdio>

namespace interneuron::netns {

namespace {

// The second byte of the IPv4 addresses of network 1.
constexpr std::size_t kFirstNetwork = 77;
// The last byte of the addresses of a vehicle and its gateway, and of the core in 10.x.0.0/24 and
// in fd77:0:n::/64.
constexpr unsigned kVehicleHost = 2;
constexpr unsigned kGatewayHost = 1;
constexpr unsigned kCoreHost = 254;
constexpr unsigned kCoreHost6 = 0xfe;

std::string hex(std::size_t number) {
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%zx", number);
  return text.data();
}

// MAC addresses are derived from what a NIC is, so that neighbours can be entered beforehand:
// resolving them by ARP would cross the emulated link and double the delay of the first packets.
enum class End : unsigned { kVehicle = 1, kGateway = 2, kRoad = 3, kCore = 4 };
std::string mac_of(End end, std::size_t host, std::size_t network) {
  std::array<char, 18> text{};
  std::snprintf(text.data(), text.size(), "02:77:%02x:%02x:00:%02x",
                static_cast<unsigned>(host + 1) & 0xffU, static_cast<unsigned>(network + 1) & 0xffU,
                static_cast<unsigned>(end));
  return text.data();
}

std::string port(char kind, std::size_t host, std::size_t network) {
  return kind + std::to_string(host + 1) + "-" + std::to_string(network + 1);
}

// False where /proc/sys is read-only (containers): the core could not be told to route IPv6.
bool ipv6_can_be_routed() {
  struct statvfs settings {};
  return ::statvfs("/proc/sys/net/ipv6/conf/all/forwarding", &settings) == 0 &&
         (settings.f_flag & ST_RDONLY) == 0;
}

// Plans single NICs: the two ends of a link (vehicle_nic, gateway) and the two ends of the pair
// between a roadside unit and the core (road_end, core_end).
struct Planner {
  const TestbedOptions& options;
  // AF_INET, and AF_INET6 where the testbed has IPv6.
  std::vector<int> families;

  std::string nic(std::size_t network) const { return "if" + options.scenario.links[network].name; }

  NicPlan vehicle_nic(std::size_t vehicle, std::size_t network) const;
  NicPlan gateway(std::size_t vehicle, std::size_t network) const;
  NicPlan road_end(std::size_t road, std::size_t network) const;
  NicPlan core_end(std::size_t road, std::size_t network) const;
};

// Adds the table and the rule by which packets from `address` leave by this NIC, wherever they go.
void route_by_source(NicPlan& plan, std::size_t network, const std::string& address,
                     const std::string& subnet, const Network& net, const std::string& gateway) {
  const auto table = kTableBase + static_cast<std::uint32_t>(network) + 1;
  plan.routes.push_back({subnet, "", address, table});
  plan.routes.push_back({net.anywhere(), gateway, "", table});
  plan.rules.push_back({address, table});
}

NicPlan Planner::vehicle_nic(std::size_t vehicle, std::size_t network) const {
  NicPlan plan{nic(network), mac_of(End::kVehicle, vehicle, network)};
  for (const int family : families) {
    const Network net(network, family);
    const std::string address = net.vehicle(vehicle);
    const std::string gateway = net.gateway(vehicle);
    plan.addresses.push_back(address + net.subnet_length());
    plan.neighbours.push_back({gateway, mac_of(End::kGateway, vehicle, network)});
    route_by_source(plan, network, address, net.vehicle_subnet(vehicle), net, gateway);
    plan.routes.push_back({net.anywhere(), gateway, "", kMainTable,
                           kTableBase + static_cast<std::uint32_t>(network) + 1});
  }
  return plan;
}

NicPlan Planner::gateway(std::size_t vehicle, std::size_t network) const {
  NicPlan plan{gateway_nic(vehicle, network), mac_of(End::kGateway, vehicle, network), true};
  for (const int family : families) {
    const Network net(network, family);
    plan.addresses.push_back(net.gateway(vehicle) + net.subnet_length());
    plan.neighbours.push_back({net.vehicle(vehicle), mac_of(End::kVehicle, vehicle, network)});
  }
  return plan;
}

NicPlan Planner::road_end(std::size_t road, std::size_t network) const {
  NicPlan plan{nic(network), mac_of(End::kRoad, road, network)};
  const std::string core_mac = mac_of(End::kCore, road, network);
  for (const int family : families) {
    const Network net(network, family);
    const std::string address = net.road(road);
    plan.addresses.push_back(address + net.subnet_length());
    plan.neighbours.push_back({net.core(), core_mac});
    // The other roadside units are reached through the core, to which each has a veth pair of its
    // own; hence the core's MAC address.
    for (std::size_t other = 0; other < options.roads; ++other) {
      if (other != road) plan.neighbours.push_back({net.road(other), core_mac});
    }
    route_by_source(plan, network, address, net.road_subnet(), net, net.core());
    plan.routes.push_back({net.everything(), net.core(), "", kMainTable});
  }
  return plan;
}

NicPlan Planner::core_end(std::size_t road, std::size_t network) const {
  NicPlan plan{road_nic(road, network), mac_of(End::kCore, road, network), true};
  for (const int family : families) {
    const Network net(network, family);
    // The core has the same address on its NICs to all roadside units, so each NIC has a route to
    // its one unit and none to the subnet.
    plan.addresses.push_back(net.core() + net.host_length());
    plan.neighbours.push_back({net.road(road), mac_of(End::kRoad, road, network)});
    plan.routes.push_back({net.road(road) + net.host_length(), "", net.core(), kMainTable});
  }
  return plan;
}

}  // namespace

Network::Network(std::size_t position, int family)
    : six_(family == AF_INET6),
      prefix_(six_ ? "fd77:0:" + hex(position + 1)
                   : "10." + std::to_string(kFirstNetwork + position)) {}

std::string Network::in_subnet(std::size_t subnet, unsigned host) const {
  if (!six_) return prefix_ + "." + std::to_string(subnet) + "." + std::to_string(host);
  return prefix_ + (subnet == 0 ? "" : ":" + hex(subnet)) + "::" + hex(host);
}

std::string Network::vehicle(std::size_t index) const { return in_subnet(index + 1, kVehicleHost); }
std::string Network::gateway(std::size_t index) const { return in_subnet(index + 1, kGatewayHost); }
std::string Network::road(std::size_t index) const {
  return in_subnet(0, static_cast<unsigned>(index) + 1);
}
std::string Network::core() const { return in_subnet(0, six_ ? kCoreHost6 : kCoreHost); }
std::string Network::vehicle_subnet(std::size_t index) const {
  return six_ ? prefix_ + ":" + hex(index + 1) + "::/64" : in_subnet(index + 1, 0) + "/24";
}
std::string Network::road_subnet() const { return prefix_ + (six_ ? "::/64" : ".0.0/24"); }
std::string Network::everything() const { return prefix_ + (six_ ? "::/48" : ".0.0/16"); }
std::string Network::anywhere() const { return six_ ? "::/0" : "0.0.0.0/0"; }
std::string Network::subnet_length() const { return six_ ? "/64" : "/24"; }
std::string Network::host_length() const { return six_ ? "/128" : "/32"; }

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

std::vector<HostPlan> plan_hosts(const State& state, const TestbedOptions& options) {
  Planner planner{options, {AF_INET}};
  if (!state.links.front().vehicle_address6.empty()) planner.families.push_back(AF_INET6);
  std::vector<HostPlan> out;
  HostPlan core{kCore, {}};
  for (std::size_t v = 0; v < options.vehicles; ++v) {
    HostPlan vehicle{{Host::Kind::kVehicle, v}, {}};
    for (std::size_t n = 0; n < options.scenario.links.size(); ++n) {
      vehicle.nics.push_back(planner.vehicle_nic(v, n));
      core.nics.push_back(planner.gateway(v, n));
    }
    out.push_back(std::move(vehicle));
  }
  for (std::size_t r = 0; r < options.roads; ++r) {
    HostPlan road{{Host::Kind::kRoad, r}, {}};
    for (std::size_t n = 0; n < options.scenario.links.size(); ++n) {
      road.nics.push_back(planner.road_end(r, n));
      core.nics.push_back(planner.core_end(r, n));
    }
    out.push_back(std::move(road));
  }
  out.push_back(std::move(core));
  return out;
}

}  // namespace interneuron::netns
