// What verify reads from the clocks and from the running testbed: counters, present rates and
// delays, and what profiles ask for. Keeps no state. Errors: TestbedError when the testbed has
// gone. Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "netns/state/snapshot.h"
#include "netns/state/state.h"
#include "netns/verify/assess.h"

namespace interneuron::cli::verify {

// The present time of CLOCK_MONOTONIC.
Duration monotonic();

const emu::DirectionStats& counters(const netns::Snapshot& snapshot, std::size_t link,
                                    Direction direction);
// What was counted, and what disturbed the testbed, between two readings.
emu::DirectionStats difference(const emu::DirectionStats& before, const emu::DirectionStats& after);
Disturbance disturbance(const netns::Snapshot& before, const netns::Snapshot& after);

// The highest scheduled rate of one link, in Mbit/s, and the longest scheduled one-way delay of
// several, within the last second. 0 before the links' time begins.
double present_mbit(const netns::State& state, std::size_t link, Direction direction);
Duration longest_delay(const netns::State& state, const std::vector<std::size_t>& links);

// What the link's profile asks for packets of `ip_bytes`. Of a profile that is not built in (a
// user's file) the content is not known here; then what the testbed counted as done counts as
// asked for.
Asked asked_of(const netns::TestbedLink& link, Direction direction,
               const emu::DirectionStats& counted, std::size_t ip_bytes);

// Why iperf3 cannot work on a link at all: its control connection is TCP, and some profiles drop
// the small packets that this needs. Empty when it can.
std::string obstacle(const netns::TestbedLink& link);

}  // namespace interneuron::cli::verify
