// Judges the links of a testbed and tells the result: compares what ping, iperf3 and tcpdump
// measured (LinkEvidence, filled by session.h) with what the links' schedule prescribed, and gives
// one Figure with a verdict per property: delay, loss, length of loss bursts, rate, order,
// duplicates.
//
// A figure beyond its bound has failed, unless a named cause explains the excess: tcpdump missed
// packets, the emulator sent frames late, the kernel dropped frames before the emulator saw them,
// iperf3 paused, or the sample is so small that chance makes such a difference. Such a cause turns
// "failed" into "inconclusive", never into "ok".
//
// Pure: no clock, no system call. Thread-compatible. No errors: evidence that is missing or
// too small gives a figure that says so.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "netns/verify/readings.h"
#include "netns/verify/schedule.h"

namespace interneuron::netns::verify {

// The bounds within which a testbed counts as right; docs/testbed.md promises them to users.
// The mean delay may differ from the scheduled mean by this much, in per cent of that.
inline constexpr double kMeanDelayPercent = 1;
// The 99th percentile of |measured - scheduled delay| over single packets, in milliseconds.
inline constexpr double kDelayErrorP99Ms = 2;
// The share of lost packets may differ from the scheduled share by this many percentage points.
inline constexpr double kLossPoints = 0.3;
// The rate of a saturated link may differ from the scheduled rate by this much, in per cent of
// that.
inline constexpr double kRatePercent = 3;
// The mean number of packets in a loss burst may differ by this much from what the profile
// prescribes, in per cent of that.
inline constexpr double kBurstPercent = 10;
// With fewer bursts than this their mean length gets no verdict: the lengths are about
// geometrically distributed, so the standard error of the mean of 1000 is some 3 %.
inline constexpr std::size_t kBurstsForVerdict = 1000;
// With fewer packets a loss is inconclusive: at 5 % loss the standard error of 10,000 packets is
// 0.22 points already.
inline constexpr std::size_t kPacketsForVerdict = 10'000;
// With fewer answered pings the round trip gets no verdict: its 99th percentile would rest on one
// or two samples.
inline constexpr std::size_t kPingsForVerdict = 200;

enum class Verdict : std::uint8_t { kOk, kFailed, kNotMeasured, kInconclusive };
// "ok", "FAILED", "not measured" or "inconclusive".
const char* verdict_name(Verdict verdict);

// One judged property of one link: a row of verify's table.
struct Figure {
  // For example "up loss".
  std::string name;
  // The unit of target and measured: "ms", "%", "Mbit/s" or "packets".
  std::string unit;
  // What the schedule prescribes, or the largest value allowed.
  std::optional<double> target;
  std::optional<double> measured;
  // Measured against target, in difference_unit; empty where the target is a largest value.
  std::optional<double> difference;
  std::string difference_unit;
  Verdict verdict = Verdict::kNotMeasured;
  // One short line that says why the verdict is not ok; empty otherwise, but for bursts, where it
  // is their number.
  std::string note;
};

// A figure that has no values, only a verdict and its reason.
Figure without_verdict(std::string name, std::string note, Verdict verdict);
// Makes the figure inconclusive for the reason `note`; one that was not measured stays as it is.
void inconclusive(Figure& figure, std::string note);

// What the profile asks of one direction besides delay, loss and rate, which the schedule holds.
struct Asked {
  bool reorder = false;
  bool duplicate = false;
  // The chain that makes losses come in bursts; empty where the profile has none.
  std::optional<emu::GilbertElliott> gilbert_elliott;
  // Policer, shaper, grants, hybrid ARQ and sleep, as Testbed::carrier() has them.
  emu::DirectionParams carrier{};
};

// What disturbed the testbed itself during a window, so that the links were not as prescribed.
struct Disturbance {
  // How long after they were due the emulator sent frames: the mean over the window, and the
  // largest value since the testbed came up.
  double late_mean_ms = 0;
  double late_max_ms = 0;
  // Frames that the kernel dropped before the emulator or after it.
  std::uint64_t kernel_drops = 0;
};

// One saturated direction of a link: iperf3 offered more than the scheduled rate. All times are
// since the epoch of the testbed's links.
struct RateRun {
  Schedule schedule;
  // What tcpdump saw at the receiving NIC, in order of time.
  std::vector<Datagram> received;
  // Packets that tcpdump missed.
  std::uint64_t capture_drops = 0;
  // As in Disturbance.
  std::uint64_t kernel_drops = 0;
  // As in Asked.
  emu::DirectionParams carrier{};
  // Why the rate was not tried; empty when it was.
  std::string not_measured;
  // Why nothing was received; empty when something was, or when the reason is not known.
  std::string failure;
};

struct DirectionEvidence {
  // The numbered datagrams sent within the window.
  Flow flow;
  // As in RateRun, of this flow.
  std::string not_measured;
  std::string failure;
  Asked asked;
  // What the testbed itself counted during the window, of all packets of this direction.
  emu::DirectionStats counted;
  RateRun rate;
  // By how much longer a packet took after a silence than one right after it; empty where that was
  // not tried.
  std::optional<Duration> woke_after{};
  // Why it was not; empty when it was, or where the radio never sleeps.
  std::string not_woken{};
};

// Everything known of one link during the window [from, to). Times are since the epoch of the
// testbed's links.
struct LinkEvidence {
  // Covers the window, and some seconds before it in which packets were already in flight.
  Schedule schedule;
  Duration from{};
  Duration to{};
  PingLog pings;
  std::size_t ping_ip_bytes = 84;
  // Indexed by Direction.
  std::array<DirectionEvidence, 2> directions;
  // Packets that tcpdump missed during the window, at both ends.
  std::uint64_t capture_drops = 0;
  Disturbance disturbance;
};

// All figures of one link.
std::vector<Figure> assess(const LinkEvidence& evidence);

// What assess() is made of, public for tests. In the two of delay, element i of both vectors is
// the same packet.
Figure judge_delay_mean(const std::string& name, const std::vector<double>& expected_ms,
                        const std::vector<double>& measured_ms);
Figure judge_delay_error(const std::string& name, const std::vector<double>& expected_ms,
                         const std::vector<double>& measured_ms);
Figure judge_loss(const std::string& name, double target_percent, double measured_percent);
Figure judge_rate(const std::string& name, const RateRun& run, Direction direction);

// The verdict on all figures of all links: failed if one has failed, else inconclusive if one is,
// else ok. Figures that were not measured do not count.
Verdict overall(const std::vector<std::vector<Figure>>& links);

// The result of verify for one link, and for all: written as a table for people and as JSON for
// programs (schema "interneuron.verify/1").
struct LinkFindings {
  // "5g", or "vehicle2/5g" of a vehicle that is not the first.
  std::string name;
  std::string profile;
  // How long the link was measured.
  Duration window{};
  // Echo requests answered within the window.
  std::size_t pings = 0;
  // iperf3's datagrams, indexed by Direction.
  std::array<std::size_t, 2> sent{};
  std::array<std::size_t, 2> received{};
  std::vector<Figure> figures;
};

struct Findings {
  std::string testbed;
  std::uint64_t seed = 0;
  std::string backend;
  Disturbance disturbance;
  std::vector<LinkFindings> links;
};

// Judges one link (assess()) and counts its packets.
LinkFindings summarise(const std::string& name, const std::string& profile,
                       const LinkEvidence& evidence);

Verdict overall(const Findings& findings);
// One row per figure, one line per link, and a last line "verify: " with the overall verdict.
std::string to_table(const Findings& findings);
// The same as JSON (schema "interneuron.verify/1"), with a line break at its end.
std::string to_json(const Findings& findings);

}  // namespace interneuron::netns::verify
