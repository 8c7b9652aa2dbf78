// Measures the links of a running testbed with ping, iperf3 and tcpdump, all links at once:
//
//   1. rates: iperf3 offers 15 % more than scheduled, vehicle -> roadside, then back, for 3.5 s;
//      tcpdump listens at the receiving NIC;
//   2. where a radio sleeps: a silence as long as it takes, and two pings;
//   3. the window, until the time is up: ping 100 times a second beside one iperf3 flow of small
//      packets each way; tcpdump listens at both NICs.
//
// All hosts are namespaces of one machine, so one clock times both ends of a link and one-way
// delays are exact. Errors: Failure (a tool does not start, the clock was set) and TestbedError
// (the testbed has gone). Not thread-safe; takes its thread for the whole measurement, and SIGINT
// ends it within a fraction of a second by an exception of SignalWatch.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "app/process/private_folder.h"
#include "netns/state/snapshot.h"
#include "netns/state/state.h"
#include "netns/verify/assess.h"

namespace interneuron::netns::verify {

struct SessionOptions {
  // Indices into State::links.
  std::vector<std::size_t> links;
  // About how long the whole measurement takes.
  Duration length{};
};

// The evidence per link, in the order of `links`. Calls `progress` with the time since the start,
// a few times a second.
std::vector<LinkEvidence> measure(const State& state, const SessionOptions& options,
                                  const std::function<void(Duration)>& progress);

// Lets the radios that sleep fall asleep, then sends a ping in this direction over each and another
// one right after it, whose answers come while the radio is awake; notes the difference. `wait`
// takes as long as it is told.
void measure_wakes(const State& state, const SessionOptions& options, Direction direction,
                   const process::PrivateFolder& folder, const std::function<void(Duration)>& wait,
                   std::vector<LinkEvidence>& evidence);

// --- What the session reads from the clocks and from the running testbed. These throw TestbedError
// when the testbed has gone; they are thread-safe.

// The present time of CLOCK_MONOTONIC.
Duration monotonic();

const emu::DirectionStats& counters(const Snapshot& snapshot, std::size_t link,
                                    Direction direction);
// What was counted, and what disturbed the testbed, between two readings.
emu::DirectionStats difference(const emu::DirectionStats& before, const emu::DirectionStats& after);
Disturbance disturbance(const Snapshot& before, const Snapshot& after);

// The highest scheduled rate of one link, in Mbit/s, what of it the buckets of its carrier let
// pass for good, and the longest scheduled one-way delay of
// several, within the last second. 0 before the links' time begins.
double present_mbit(const State& state, std::size_t link, Direction direction);
double lasting_mbit(const State& state, std::size_t link, Direction direction);
Duration longest_delay(const State& state, const std::vector<std::size_t>& links);

// What the link's profile asks for packets of `ip_bytes`. Of a profile that is not built in (a
// user's file) the content is not known here; then what the testbed counted as done counts as
// asked for.
Asked asked_of(const TestbedLink& link, Direction direction, const emu::DirectionStats& counted,
               std::size_t ip_bytes);

// Why iperf3 cannot work on a link at all: its control connection is TCP, and some profiles drop
// the small packets that this needs. Empty when it can.
std::string obstacle(const TestbedLink& link);

// --- How long verify waits ---

// How long verify waits for tcpdump to start and for the first packet. A loaded machine starts
// tcpdump within one second.
inline constexpr Duration kToolStart = std::chrono::seconds(5);
// How long verify waits until iperf3 sends. Before that it agrees with its peer, which takes ten
// round trips at the most; the longest round trip of a profile is 1 s.
inline constexpr Duration kIperfStart = std::chrono::seconds(10);
// iperf3 is started anew when it has sent nothing after this and ten round trips.
inline constexpr Duration kIperfPatience = std::chrono::seconds(2);
// How long captured packets need to reach tcpdump's file: the kernel hands a block over after 1 s.
inline constexpr Duration kCaptureFlush = std::chrono::milliseconds(1300);
// The longest that verify waits for packets in flight to arrive.
inline constexpr Duration kLongestDrain = std::chrono::seconds(5);
// How long a silence is waited for, at most, so that a radio falls asleep, and how much longer
// than that takes.
inline constexpr Duration kLongestSilence = std::chrono::seconds(15);
inline constexpr Duration kSilenceMargin = std::chrono::milliseconds(500);
// What is left out at both edges of the window, where the flows are just starting or stopping.
inline constexpr Duration kEdge = std::chrono::milliseconds(200);

// --- How much it measures ---

// How long the bottleneck is saturated in one direction: 0.7 s in which its queue builds up, then
// at least the 1 s that rate.cc wants and 1 s for its ends.
inline constexpr Duration kRateTime = std::chrono::milliseconds(3500);
// What is offered to saturate a link, as a multiple of its scheduled rate.
inline constexpr double kOffered = 1.15;
// Bytes of UDP payload that saturate a link.
inline constexpr std::size_t kRatePayload = 1400;
// A link with a higher rate is not saturated: namespaces, emulator and tcpdump together carried
// about this much on two CPUs.
inline constexpr double kMostMbit = 600;
// What links saturated at the same time may offer together; further links wait for their turn.
inline constexpr double kMostAtOnceMbit = 500;
// The window lasts at least this long, even if the time asked for is up.
inline constexpr Duration kShortestWindow = std::chrono::seconds(5);
// Packets per direction during the window: 50,000 and those at its edges.
inline constexpr double kWantedPackets = 52'500;
// Bounds of a flow's packets per second. Four flows at the upper bound keep a busy machine of two
// CPUs occupied.
inline constexpr double kFewestPerSecond = 300;
inline constexpr double kMostPerSecond = 5000;
// The share of a link's rate that a flow of the window may use, so that hardly a queue builds up.
inline constexpr double kSmallShare = 0.25;
// How many times as many packets go over a link whose losses come in bursts. Bursts of five packets
// make the measured loss vary three times as much as single losses do (chance_of_loss()), and a
// thousand bursts are wanted: four times as many packets halve the former and make the latter.
inline constexpr double kBurstyFactor = 4;

// --- What it looks at ---

// A flow sends once this many packets are on its link: more than iperf3 needs to agree with its
// peer.
inline constexpr std::uint64_t kFlowingPackets = 60;
// A wall clock that moved by more than this against CLOCK_MONOTONIC was set, and the captures are
// useless. A clock that NTP slews by 10 ppm moves by 0.6 ms in a minute.
inline constexpr Duration kClockStep = std::chrono::milliseconds(1);
// How far before the window the schedule is read: longer than packets travel.
inline constexpr Duration kLookBack = std::chrono::seconds(3);

}  // namespace interneuron::netns::verify
