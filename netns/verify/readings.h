// Parses what the measuring tools wrote: ping's lines, tcpdump's captures of iperf3's datagrams,
// and tcpdump's last report.
//
// iperf3 (3.12, 32-bit counters) begins each UDP payload with 12 bytes in network order: seconds
// and microseconds of CLOCK_MONOTONIC before the sending call, and a number that counts from 1.
//
// The bytes may be anything (the emulator corrupts packets on purpose): every length is checked
// before it is used, and whatever does not parse is skipped. Memory is linear in the input. Pure;
// thread-compatible; never throws.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::cli::verify {

// One answered echo request, by its first answer.
struct Ping {
  std::uint32_t sequence = 0;
  // Of the wall clock as parsed; session.cc moves it to the time of the links.
  Duration sent{};
  Duration round_trip{};
};

struct PingLog {
  // In the order in which the answers arrived.
  std::vector<Ping> answered;
  // From ping's summary; 0 when it was killed before it wrote one.
  std::size_t transmitted = 0;
};

// Reads the output of `ping -D`. It prints the wall clock at which an answer arrived; the time of
// sending is that minus the round-trip time.
PingLog parse_ping(std::string_view text);

// One datagram of iperf3 as tcpdump saw it.
struct Datagram {
  // When tcpdump saw it: of the wall clock as parsed; session.cc moves it to the time of the links.
  Duration seen{};
  std::uint16_t from_port = 0;
  std::uint16_t to_port = 0;
  // The total length from the IP header, although less of it may have been captured.
  std::size_t ip_bytes = 0;
  std::uint32_t number = 0;
  // When iperf3 sent it: of CLOCK_MONOTONIC as parsed, then moved like `seen`.
  Duration stamp{};
};

// tcpdump must capture this many bytes of each frame: 14 of Ethernet, 20 of IPv4, 8 of UDP and 12
// of iperf3 are 54.
inline constexpr int kCaptureBytes = 64;

// Reads a pcap file of Ethernet frames; nullopt when `bytes` is no such file. A record that is cut
// off at the end is skipped, as is every frame that is not IPv4 with iperf3's payload.
std::optional<std::vector<Datagram>> parse_capture(std::string_view bytes);

// The number in "12 packets dropped by kernel", which tcpdump writes when it ends; nullopt when the
// text has no such line.
std::optional<std::uint64_t> parse_capture_drops(std::string_view text);

}  // namespace interneuron::cli::verify
