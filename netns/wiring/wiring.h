// Names the NICs of a testbed and makes them in the namespaces of its hosts: veth pairs, addresses,
// routes and rules, through libnl. Thread-compatible: acts on the calling thread's namespace.
// Errors: TestbedError.
#pragma once

#include <string>
#include <vector>

#include "netns/state/options.h"
#include "netns/state/state.h"
#include "netns/wiring/namespaces.h"

namespace interneuron::netns {

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

// Makes all NICs that `state` names, and what `options` ask for besides (nat). The caller must be
// in namespaces.air and is there again at the end. All NICs are operational when it returns.
void wire(const State& state, const TestbedOptions& options, const Namespaces& namespaces);

}  // namespace interneuron::netns
