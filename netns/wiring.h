// Wires a testbed: veth pairs, addresses, neighbours, offloads. By libnl and ioctl; no other
// program is run. Thread-safety: none; enters namespaces on the calling thread and returns to the
// middle one.
#pragma once

#include <string>
#include <vector>

#include "netns/namespaces.h"
#include "netns/testbed.h"

namespace interneuron::netns {

// Names of the ends in the middle namespace, where the emulator sits.
std::string vehicle_port(const std::string& link_name);  // "v5g"
std::string road_port(const std::string& link_name);     // "r5g"

// What a link of this name and position (from 0) gets: NIC "if" + name, addresses 10.77.<position +
// 1>.{1,2}.
TestbedLink plan_link(const LinkSpec& spec, std::size_t position);

// Makes and configures everything, waits until every NIC is operational (at most 5 s).
// Throws TestbedError.
void wire(const std::vector<TestbedLink>& links, const Namespaces& namespaces);

}  // namespace interneuron::netns
