#include "netns/verify/tools.h"

#include <fmt/format.h>

#include "netns/verify/readings.h"

namespace interneuron::cli::verify {

namespace {

// tcpdump's capture buffer. 30,000 packets a second of kCaptureBytes fill a third of it in a
// second, the longest time for which tcpdump lets packets wait.
constexpr int kCaptureBufferKib = 16 * 1024;
// Seconds between echo requests. Debian's ping allows any user 2 ms and more.
constexpr const char* kPingInterval = "0.01";

}  // namespace

std::uint16_t port_of(std::uint16_t first, std::size_t slot, Direction direction) {
  return static_cast<std::uint16_t>(first + 2 * slot + (direction == Direction::kDown ? 1 : 0));
}

std::vector<std::string> iperf_server(const IperfFlow& flow) {
  return {"iperf3",      "-s", "-1", "-B", flow.link.road_address, "-p", std::to_string(flow.port),
          "--forceflush"};
}

std::vector<std::string> iperf_client(const IperfFlow& flow, int seconds) {
  std::vector<std::string> argv{"iperf3",      "-u",
                                "-c",          flow.link.road_address,
                                "-B",          flow.link.vehicle_address,
                                "-p",          std::to_string(flow.port),
                                "-l",          std::to_string(flow.payload_bytes),
                                "-b",          fmt::format("{:.0f}", flow.payload_bits_per_second),
                                "-t",          std::to_string(seconds),
                                "--forceflush"};
  if (flow.direction == Direction::kDown) argv.emplace_back("-R");
  return argv;
}

std::vector<std::string> tcpdump(const std::string& nic, const std::vector<std::uint16_t>& ports,
                                 bool both_ways) {
  std::string filter = "udp and (";
  for (const std::uint16_t port : ports) {
    filter += fmt::format("{}port {}", port == ports.front() ? "" : " or ", port);
  }
  // -Z root: tcpdump keeps its user instead of becoming "tcpdump", which may not exist inside the
  // testbed's user namespace. It writes nothing but its stdout.
  return {"tcpdump",
          "-n",
          "-p",
          "-i",
          nic,
          "-s",
          std::to_string(kCaptureBytes),
          "-B",
          std::to_string(kCaptureBufferKib),
          "-Q",
          both_ways ? "inout" : "in",
          "-Z",
          "root",
          "-w",
          "-",
          filter + ")"};
}

std::vector<std::string> ping(const netns::TestbedLink& link) {
  return {"ping", "-n", "-D", "-i", kPingInterval, "-I", link.vehicle_address, link.road_address};
}

netns::Host vehicle_of(const netns::TestbedLink& link) {
  return {netns::Host::Kind::kVehicle, link.vehicle};
}

netns::Host receiver_of(const netns::TestbedLink& link, Direction direction) {
  return direction == Direction::kUp ? netns::kRoad : vehicle_of(link);
}

}  // namespace interneuron::cli::verify
