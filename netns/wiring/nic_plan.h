// What the NICs of a testbed are to have, as text, before the kernel hears of it: the addressing of
// testbed.h worked out for every host. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "netns/state/hosts.h"
#include "netns/state/options.h"
#include "netns/state/state.h"

namespace interneuron::netns {

// Table, preference and metric of network n are one number: 100 + n.
inline constexpr std::uint32_t kTableBase = 100;
inline constexpr std::uint32_t kMainTable = 254;  // RT_TABLE_MAIN of linux/rtnetlink.h

struct NeighbourPlan {
  std::string address;
  std::string mac;
};

struct RoutePlan {
  std::string destination;  // "10.77.0.0/16", "::/0"
  std::string gateway;      // empty: the destination is on the NIC's own wire
  std::string source;       // which address to send from; empty: the kernel's choice
  std::uint32_t table = kMainTable;
  std::uint32_t metric = 0;
};

// Packets from `source` are routed by `table`.
struct RulePlan {
  std::string source;
  std::uint32_t table = 0;
};

struct NicPlan {
  std::string nic;
  std::string mac;  // locally administered
  bool forwards = false;
  std::vector<std::string> addresses{};  // with their prefix lengths
  std::vector<NeighbourPlan> neighbours{};
  std::vector<RoutePlan> routes{};
  std::vector<RulePlan> rules{};
};

struct HostPlan {
  Host host;
  std::vector<NicPlan> nics{};
};

// Vehicles, roadside units, core. IPv6 is left out where `state` has no IPv6 addresses.
std::vector<HostPlan> plan_hosts(const State& state, const TestbedOptions& options);

// One family's addresses on one network (position, from 0).
class Network {
 public:
  Network(std::size_t position, int family);

  // Of vehicle or roadside unit, by position.
  std::string vehicle(std::size_t index) const;
  std::string gateway(std::size_t index) const;
  std::string road(std::size_t index) const;
  std::string core() const;                             // as the roadside units see it
  std::string vehicle_subnet(std::size_t index) const;  // "10.77.1.0/24"
  std::string road_subnet() const;                      // "10.77.0.0/24"
  std::string everything() const;                       // "10.77.0.0/16"
  std::string anywhere() const;                         // "0.0.0.0/0"
  std::string subnet_length() const;                    // "/24"
  std::string host_length() const;                      // "/32"

 private:
  std::string in_subnet(std::size_t subnet, unsigned host) const;

  bool six_;
  std::string prefix_;
};

}  // namespace interneuron::netns
