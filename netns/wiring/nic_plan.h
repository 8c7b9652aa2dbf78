// Works out the addressing that netns/testbed/testbed.h describes: for every NIC of every host its
// name, addresses, neighbours, routes and rules, as text. nics.h gives them to the kernel. Pure but
// for plan_links(), which asks whether the kernel lets IPv6 be routed; thread-compatible; no
// errors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "netns/state/hosts.h"
#include "netns/state/options.h"
#include "netns/state/state.h"

namespace interneuron::netns {

// Network n (from 1) has the routing table 100 + n; the preference of its rule and the metric of
// its default route are the same number.
inline constexpr std::uint32_t kTableBase = 100;
// RT_TABLE_MAIN of linux/rtnetlink.h.
inline constexpr std::uint32_t kMainTable = 254;

struct NeighbourPlan {
  std::string address;
  std::string mac;
};

struct RoutePlan {
  // For example "10.77.0.0/16" or "::/0".
  std::string destination;
  // Empty when the NIC reaches the destination without a gateway.
  std::string gateway;
  // The address from which packets are sent; empty leaves that to the kernel.
  std::string source;
  std::uint32_t table = kMainTable;
  std::uint32_t metric = 0;
};

// A rule: packets from `source` are routed by `table`.
struct RulePlan {
  std::string source;
  std::uint32_t table = 0;
};

struct NicPlan {
  std::string nic;
  // A locally administered address.
  std::string mac;
  // Whether packets that come in here are forwarded.
  bool forwards = false;
  // Each with its prefix length.
  std::vector<std::string> addresses{};
  std::vector<NeighbourPlan> neighbours{};
  std::vector<RoutePlan> routes{};
  std::vector<RulePlan> rules{};
};

struct HostPlan {
  Host host;
  std::vector<NicPlan> nics{};
};

// The plans of all hosts: vehicles, then roadside units, then the core. They have IPv6 where
// `state` has IPv6 addresses.
std::vector<HostPlan> plan_hosts(const State& state, const TestbedOptions& options);

// Names of NICs; vehicles, roadside units and networks are given by their index from 0. A link is
// one veth pair with netem
//   vehicle:nic  ═══  core:gateway_nic
// and two, joined by the holder, with the emulator
//   vehicle:nic ═══ air:vehicle_port   air:core_port ═══ core:gateway_nic
// For the first vehicle on the first network they are "v1-1", "c1-1" and "g1-1".
std::string vehicle_port(std::size_t vehicle, std::size_t network);
std::string core_port(std::size_t vehicle, std::size_t network);
std::string gateway_nic(std::size_t vehicle, std::size_t network);
// Each roadside unit has one pair road:nic ═══ core:road_nic per network, which impairs nothing.
// The name is "r1-1" for the first unit on the first network.
std::string road_nic(std::size_t road, std::size_t network);

// The address of a roadside unit on a network; `family` is AF_INET or AF_INET6.
std::string road_address(std::size_t road, std::size_t network, int family);

// The links of all vehicles, in the order of State::links. Where the kernel has no IPv6 the
// fields *6 are empty.
std::vector<TestbedLink> plan_links(const TestbedOptions& options);

// The addresses of one family (AF_INET or AF_INET6) on one network, given by its position from 0,
// as text. The examples are of IPv4 and the first network.
class Network {
 public:
  Network(std::size_t position, int family);

  // Addresses of a vehicle, of its gateway and of a roadside unit, by their index from 0.
  std::string vehicle(std::size_t index) const;
  std::string gateway(std::size_t index) const;
  std::string road(std::size_t index) const;
  // The core's address on the side of the roadside units.
  std::string core() const;
  // "10.77.1.0/24" of the first vehicle.
  std::string vehicle_subnet(std::size_t index) const;
  // "10.77.0.0/24"
  std::string road_subnet() const;
  // All addresses of the network: "10.77.0.0/16".
  std::string everything() const;
  // All addresses of the family: "0.0.0.0/0".
  std::string anywhere() const;
  // Prefix lengths of a subnet and of a single host: "/24", "/32".
  std::string subnet_length() const;
  std::string host_length() const;

 private:
  std::string in_subnet(std::size_t subnet, unsigned host) const;

  bool six_;
  std::string prefix_;
};

}  // namespace interneuron::netns
