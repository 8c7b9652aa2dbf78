// What keeps the generator of attacks from harming anybody: it sends over veths in a namespace of a
// test, and over nothing else. Also what its parts share of sockets and text.
#pragma once

#include <cstdint>
#include <string>

#include "interneuron/time.h"
#include "node/io/file_descriptor.h"

namespace interneuron::attacker {

// An IPv4 address and a port, in the order of this host.
struct Place {
  std::uint32_t host = 0;
  std::uint16_t port = 0;
};
// "10.0.0.1:47000". Throws std::runtime_error that names the text.
Place parse_place(const std::string& text);
// "10.0.0.1".
std::uint32_t parse_host(const std::string& text);
std::string to_string(Place place);

// Throws std::runtime_error unless `nic` is a veth, this network namespace was made by `ip netns`
// and is not that of the first process, and no route leads out of it.
void require_confined(const std::string& nic);

// A UDP socket that is bound to the NIC and does not block; with `to`, connected. Throws
// std::runtime_error that names the call.
io::FileDescriptor open_udp(const std::string& nic, Place from, const Place* to);

// CLOCK_MONOTONIC.
TimePoint now();
double seconds_between(TimePoint from, TimePoint to);

[[noreturn]] void fail_call(const std::string& call);

}  // namespace interneuron::attacker
