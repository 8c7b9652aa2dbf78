// The command lines of ping, iperf3 and tcpdump, and the ports that tell flows of iperf3 apart.
// Pure; thread-compatible; no errors.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "netns/state/hosts.h"
#include "netns/state/state.h"
#include "netns/verify/schedule.h"

namespace interneuron::cli::verify {

// Bytes of UDP payload in the flows of the window: small, so that they hardly make a queue.
inline constexpr std::size_t kSmallPayload = 100;
// IP bytes of an echo request: ping's 56 bytes of data with the headers of ICMP and IPv4.
inline constexpr std::size_t kPingIpBytes = 84;

// One iperf3 flow over one direction of a link. The server listens at the roadside for either
// direction; its port identifies the flow, also behind a NAT, which changes only the vehicle's.
struct IperfFlow {
  netns::TestbedLink link;
  Direction direction = Direction::kUp;
  std::uint16_t port = 0;
  std::size_t payload_bytes = 0;
  double payload_bits_per_second = 0;
};

// The first server port of the window's flows and of the rate flows. IANA has assigned neither
// range; the 500 between them are enough for 250 links.
inline constexpr std::uint16_t kFirstPort = 46000;
inline constexpr std::uint16_t kFirstRatePort = 46500;
// The server port of the `slot`-th measured link; each link has two, one per direction.
std::uint16_t port_of(std::uint16_t first, std::size_t slot, Direction direction);

std::vector<std::string> iperf_server(const IperfFlow& flow);
// The client sends (or, downwards, lets the server send) for `seconds` and ends by itself.
std::vector<std::string> iperf_client(const IperfFlow& flow, int seconds);
// Captures the UDP packets of `ports` to its stdout; without `both_ways` only those that arrive at
// the NIC.
std::vector<std::string> tcpdump(const std::string& nic, const std::vector<std::uint16_t>& ports,
                                 bool both_ways);
std::vector<std::string> ping(const netns::TestbedLink& link);

netns::Host vehicle_of(const netns::TestbedLink& link);
// The host that receives the packets of a direction.
netns::Host receiver_of(const netns::TestbedLink& link, Direction direction);

}  // namespace interneuron::cli::verify
