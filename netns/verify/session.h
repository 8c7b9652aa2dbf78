// Measures the links of a running testbed with ping, iperf3 and tcpdump, all links at once:
//
//   1. rates: iperf3 offers 15 % more than scheduled, vehicle -> roadside, then back, for 3.5 s;
//      tcpdump listens at the receiving NIC;
//   2. the window, until the time is up: ping 100 times a second beside one iperf3 flow of small
//      packets each way; tcpdump listens at both NICs.
//
// All hosts are namespaces of one machine, so one clock times both ends of a link and one-way
// delays are exact. Errors: Failure (a tool does not start, the clock was set) and TestbedError
// (the testbed has gone). Not thread-safe; takes its thread for the whole measurement, and SIGINT
// ends it within a fraction of a second by an exception of SignalWatch.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "netns/state/state.h"
#include "netns/verify/assess.h"

namespace interneuron::cli::verify {

struct SessionOptions {
  // Indices into State::links.
  std::vector<std::size_t> links;
  // About how long the whole measurement takes.
  Duration length{};
};

// The evidence per link, in the order of `links`. Calls `progress` with the time since the start,
// a few times a second.
std::vector<LinkEvidence> measure(const netns::State& state, const SessionOptions& options,
                                  const std::function<void(Duration)>& progress);

}  // namespace interneuron::cli::verify
