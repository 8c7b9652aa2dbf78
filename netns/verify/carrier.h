// Judges what the carrier of a link does beside delay, loss and rate: policer, shaper, grants,
// hybrid ARQ and sleep. The first three show in the flow that saturates the link, from what tcpdump
// saw at the receiver; hybrid ARQ shows in the delays of the window's small packets, sleep in
// pings. Pure: no clock, no system call. Thread-compatible. No errors.
#pragma once

#include <string>
#include <vector>

#include "netns/verify/assess.h"

namespace interneuron::netns::verify {

// A rate behind a bucket, a burst in its bytes, and a share of what is dropped may differ by this
// much from what the profile says: in per cent of the first two, and in points.
inline constexpr double kBucketRatePercent = 3;
inline constexpr double kBucketBurstPercent = 10;
inline constexpr double kPolicedPoints = 3;
// And these: the period of grants in per cent, their share of the time in points, the step of
// hybrid ARQ in per cent, the share of packets that it makes late and a wake-up in per cent of
// these.
inline constexpr double kGrantPercent = 3;
inline constexpr double kGrantSharePoints = 5;
inline constexpr double kHarqStepPercent = 10;
inline constexpr double kHarqLatePercent = 15;
inline constexpr double kWakePercent = 10;

// The figures of what the carrier does to one direction; none where it does nothing. `course` has
// the packets of the evidence's flow.
std::vector<Figure> judge_carrier(const std::string& name, const DirectionEvidence& evidence,
                                  Direction direction, const Course& course);
// Whether it delays packets in a way that the schedule does not tell.
bool delays(const emu::DirectionParams& carrier);

}  // namespace interneuron::netns::verify
