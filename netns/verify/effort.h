// How long verify measures, how much traffic it sends and how long it waits: the constants of
// session.cc with their reasons.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "interneuron/time.h"

namespace interneuron::cli::verify {

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

}  // namespace interneuron::cli::verify
