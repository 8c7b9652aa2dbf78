// What the transports of a NIC cost: processor time per datagram of one that sends and of one that
// receives, at the same pace, over a veth pair between two network namespaces, each on a processor
// of its own if there are two.
//
// measure() moves the calling process into namespaces of its own, which end with it: it must have
// one thread and do nothing else afterwards. Root, or a user namespace. Each load is measured over
// each transport in turn, kRepetitions times, and the median counts, so that what else the machine
// does meets all alike. Processor time is that of the sending and of the receiving thread
// (RUSAGE_THREAD), with the kernel's work inside their calls and what it does in their name; what
// the kernel does elsewhere counts for nobody.
//
// Errors: netns::TestbedError (5) where namespaces are forbidden; io::IoError of a transport that
// cannot be opened is its row's `failure`.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/node_options.h"
#include "interneuron/time.h"

namespace interneuron::transport_costs {

// Bursts of equal datagrams.
struct Load {
  std::string_view name;
  std::string_view about;
  // How many a burst has, and the bytes of UDP payload of each.
  std::size_t datagrams = 0;
  std::size_t bytes = 0;
  Duration interval{};
};

inline constexpr std::array<Load, 3> kLoads{{
    {"images", "128 KiB in 94 datagrams of 1400 bytes, every 10 ms", 94, 1400,
     std::chrono::milliseconds(10)},
    {"lists", "4 datagrams of 1400 bytes every 2 ms", 4, 1400, std::chrono::milliseconds(2)},
    {"single", "1 datagram of 300 bytes every millisecond", 1, 300, std::chrono::milliseconds(1)},
}};

inline constexpr std::array kTransports{TransportKind::kUdp, TransportKind::kRing,
                                        TransportKind::kXdp};

inline constexpr int kRepetitions = 5;

struct Row {
  const Load* load = nullptr;
  TransportKind transport{};
  // Datagrams of all repetitions.
  std::size_t sent = 0;
  std::size_t lost = 0;
  // Microseconds per datagram; medians of the repetitions.
  double send_us = 0;
  double receive_us = 0;
  // Why it could not be measured, one line; then the figures are 0.
  std::string failure{};
};

// `progress` is told before each run: how many are done, and of how many. Each run takes `length`.
std::vector<Row> measure(Duration length,
                         const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace interneuron::transport_costs
