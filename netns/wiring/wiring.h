// Which NICs a testbed has, and making them: veth pairs, addresses, routes and rules, through
// libnl. Errors: TestbedError.
#pragma once

#include <string>
#include <vector>

#include "netns/state/options.h"
#include "netns/state/state.h"
#include "netns/wiring/namespaces.h"

namespace interneuron::netns {

// NICs by the vehicle's or roadside unit's and the network's position, from 0.
//
// Per link: with netem one pair
//   vehicle:nic  ═══  core:gateway_nic
// and with the emulator two, joined by the holder
//   vehicle:nic ═══ air:vehicle_port   air:core_port ═══ core:gateway_nic
std::string vehicle_port(std::size_t vehicle, std::size_t network);  // "v1-1"
std::string core_port(std::size_t vehicle, std::size_t network);     // "c1-1"
std::string gateway_nic(std::size_t vehicle, std::size_t network);   // "g1-1"
// And per roadside unit and network one pair road:nic === core:road_nic, which impairs nothing.
std::string road_nic(std::size_t road, std::size_t network);  // "r1-1"

// Of a roadside unit on a network, by position; `family` is AF_INET or AF_INET6.
std::string road_address(std::size_t road, std::size_t network, int family);

// The links of all vehicles as State::links lists them. Without IPv6 in the kernel the *6 are
// empty.
std::vector<TestbedLink> plan_links(const TestbedOptions& options);

// Makes everything that `state` names and `options` ask for. The caller is in namespaces.air and is
// there again at the end. All NICs are operational when it returns.
void wire(const State& state, const TestbedOptions& options, const Namespaces& namespaces);

}  // namespace interneuron::netns
