// Measures the links of a running testbed with ping, iperf3 and tcpdump, all links at once:
//
//   1. rates: iperf3 offers 15 % more than scheduled, vehicle -> roadside, then back, for 3.5 s;
//      tcpdump listens at the receiving NIC;
//   2. the window, until the time is up: ping 100 times a second beside one iperf3 flow of small
//      packets each way; tcpdump listens at both NICs.
//
// The time of both is read from one clock, as all hosts are namespaces of one machine. Errors:
// Failure, TestbedError. Thread-safety: none.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "netns/state/state.h"
#include "netns/verify/assess.h"

namespace interneuron::cli::verify {

struct SessionOptions {
  std::vector<std::size_t> links;  // indices into State::links
  Duration length{};               // of the whole, about
};

// The evidence per link, in the order of `links`. `progress` is told the time since the start, a
// few times a second at most.
std::vector<LinkEvidence> measure(const netns::State& state, const SessionOptions& options,
                                  const std::function<void(Duration)>& progress);

}  // namespace interneuron::cli::verify
