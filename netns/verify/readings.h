// What the independent tools left behind, as values: ping's lines, tcpdump's captures of iperf3's
// datagrams, tcpdump's report. Pure; never throws; what does not parse is skipped.
//
// iperf3 (3.12, 32-bit counters) begins each UDP payload with, in network order: seconds and
// microseconds of CLOCK_MONOTONIC before the sending call, and a number counting from 1.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::cli::verify {

// One answered echo request; of several answers the first. Times are of whatever clock the reader
// was given.
struct Ping {
  std::uint32_t sequence = 0;
  Duration sent{};
  Duration round_trip{};
};

struct PingLog {
  std::vector<Ping> answered;   // in the order of the answers
  std::size_t transmitted = 0;  // 0 when ping did not end by itself
};

// Of `ping -D`, which prints the wall clock when it has got the answer: sent is that minus the
// round-trip time.
PingLog parse_ping(std::string_view text);

// One datagram of iperf3 as tcpdump saw it.
struct Datagram {
  Duration seen{};  // of the wall clock, until moved
  std::uint16_t from_port = 0;
  std::uint16_t to_port = 0;
  std::size_t ip_bytes = 0;
  std::uint32_t number = 0;
  Duration stamp{};  // iperf3's
};

// Bytes of a frame that must be captured to read the above.
inline constexpr int kCaptureBytes = 64;

// A pcap file of Ethernet frames; nullopt when it is none. A record cut off at the end is skipped,
// as is all but IPv4 with iperf3's payload.
std::optional<std::vector<Datagram>> parse_capture(std::string_view bytes);

// "12 packets dropped by kernel" of tcpdump's last words; nullopt when it said nothing of it.
std::optional<std::uint64_t> parse_capture_drops(std::string_view text);

}  // namespace interneuron::cli::verify
