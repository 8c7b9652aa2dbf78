// The command lines of the tools, and what identifies a flow of iperf3. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "netns/state/hosts.h"
#include "netns/state/state.h"
#include "netns/verify/schedule.h"

namespace interneuron::cli::verify {

inline constexpr std::size_t kUdpIpHeaders = 28;   // IPv4 without options
inline constexpr std::size_t kSmallPayload = 100;  // bytes, of the window's flows
inline constexpr std::size_t kPingIpBytes = 84;    // ping's 56 bytes with ICMP and IPv4 headers

// The flow of one direction: its port is the server's, at the roadside, so it tells flows apart
// behind a NAT as well.
struct IperfFlow {
  netns::TestbedLink link;
  Direction direction = Direction::kUp;
  std::uint16_t port = 0;
  std::size_t payload_bytes = 0;
  double payload_bits_per_second = 0;
};

// Of link `slot` of those measured; two per link from these on, unassigned by IANA.
inline constexpr std::uint16_t kFirstPort = 46000;
inline constexpr std::uint16_t kFirstRatePort = 46500;
std::uint16_t port_of(std::uint16_t first, std::size_t slot, Direction direction);

std::vector<std::string> iperf_server(const IperfFlow& flow);
// Ends by itself `seconds` after the start.
std::vector<std::string> iperf_client(const IperfFlow& flow, int seconds);
// Writes a capture to its stdout; without `both_ways` only what arrives at the NIC.
std::vector<std::string> tcpdump(const std::string& nic, const std::vector<std::uint16_t>& ports,
                                 bool both_ways);
std::vector<std::string> ping(const netns::TestbedLink& link);

netns::Host vehicle_of(const netns::TestbedLink& link);
// Who gets the packets of a direction.
netns::Host receiver_of(const netns::TestbedLink& link, Direction direction);

}  // namespace interneuron::cli::verify
