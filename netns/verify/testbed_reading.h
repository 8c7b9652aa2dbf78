// What verify asks of the clocks and of the running testbed. Errors: TestbedError. Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "netns/state/snapshot.h"
#include "netns/state/state.h"
#include "netns/verify/assess.h"

namespace interneuron::cli::verify {

// CLOCK_MONOTONIC.
Duration monotonic();
// The wall clock minus CLOCK_MONOTONIC, exact to a microsecond but for a step in between.
Duration wall_offset();

const emu::DirectionStats& counters(const netns::Snapshot& snapshot, std::size_t link,
                                    Direction direction);
// What was counted between two readings.
emu::DirectionStats difference(const emu::DirectionStats& before, const emu::DirectionStats& after);
Disturbance disturbance(const netns::Snapshot& before, const netns::Snapshot& after);

// The highest scheduled rate of a link, and the longest one-way delay of some, in the last second.
// 0 before the links' time begins.
double present_mbit(const netns::State& state, std::size_t link, Direction direction);
Duration longest_delay(const netns::State& state, const std::vector<std::size_t>& links);

// Of a profile that the program knows; of another what the testbed counted that it has done.
// `ip_bytes`: of the packets in question.
Asked asked_of(const netns::TestbedLink& link, Direction direction,
               const emu::DirectionStats& counted, std::size_t ip_bytes);

// Why iperf3 cannot work on a link at all; empty when it can.
std::string obstacle(const netns::TestbedLink& link);

}  // namespace interneuron::cli::verify
