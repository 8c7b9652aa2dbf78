// Nature scores: how well each link does relative to the best link that is up (docs/paper.md,
// "Nature"). Pure; no allocation.
#pragma once

#include <compare>
#include <cstdint>
#include <span>

#include "interneuron/link.h"

namespace interneuron::link {

// Sets `nature` of every link from the other fields:
// - delay: best / this, of RTT p95 / 2 + queue_up (data goes up; the downlink's queue is in the
// RTT);
// - bandwidth: this / best, of the rate;
// - reliability: best / this, of the loss, which counts as kLossFloor at least, divided by the
// share
//   of time not in outage (at least kLeastUptime);
// - security: 0 = clear on a foreign network, 0.5 = trusted (1 once sessions are encrypted too).
//
// "best" is over the links that are up; the best one has exactly 1. A link that is down has 0
// everywhere and sets no standard. Scores are ratios: scaling a quantity on all links changes none
// of them.
//
// Age: evidence that lost confidence (below) counts as worse than measured, by
// 1 / (1/2 + confidence/2): at worst as half as good, which is where unmeasured links begin.
//
// What was not measured yet on a link that is up (RTT 0, rate 0; the loss has been measured once
// the RTT has) scores kUnmeasured times the lowest score of those measured: behind each of them,
// before nothing. Where no link that is up was measured, all are equal: 1.
void score(std::span<LinkState> links);

// 1 while `age` is within `grace`, then halves every `half_life`. Age max() = never: 0.
double confidence(Duration age, Duration grace, Duration half_life);
// Of everything but the rate. Idle heartbeats come every 300 ms: up to three missing ones are no
// news; a radio's bad episodes begin within seconds (docs/constants.md, "Three-state model").
inline constexpr Duration kGrace = std::chrono::seconds(1);
inline constexpr Duration kHalfLife = std::chrono::seconds(5);
// Of the rate: trains on an idle link come every 10 s (ProbeSchedule), its rate changes with place
// and load of the cell, in tens of seconds. Chosen.
inline constexpr Duration kRateGrace = std::chrono::seconds(12);
inline constexpr Duration kRateHalfLife = std::chrono::seconds(30);

// Why a link has its scores: the quantity that counted, the best one it was compared with, both
// after age; nothing measured: 0.
struct Reason {
  double value = 0;
  double best = 0;
  double confidence = 0;  // [0, 1]
  bool measured = false;
};
struct Evidence {
  Reason delay;        // s
  Reason bandwidth;    // bit/s
  Reason reliability;  // share lost or in outage
  bool trusted = false;
  bool encrypted = false;
};
// `links`: those that `link` was scored among.
Evidence explain(const LinkState& link, std::span<const LinkState> links);

enum class Field : std::uint8_t { kDelay, kBandwidth, kReliability };
// Whether two links are told apart on a field by what was measured: `greater` = a is better, `less`
// = b is; `equivalent` never; `unordered` = undecided, because one is not measured or the
// difference is within what chance explains. Decided are:
// - delay: |difference| of RTT p95 / 2 + queue_up above 1.64 standard errors of both, that of a
// link
//   being 2.1 sd / sqrt(rtt_samples) (p95 of n normal values; sd = 1.25 RTTVAR), for half the round
//   trip, and above 2 %; and the smallest round trips agree, so that a queue of our own making on
//   the better link decides nothing;
// - bandwidth: ratio of the rates above kRateApart, both from trains of full length;
// - reliability: |difference| of the losses above 1.64 standard errors of both,
//   sqrt(p (1 - p) (2 burst - 1) / loss_packets); p as if one more packet had been lost.
std::partial_ordering compare(const LinkState& a, const LinkState& b, Field field);
inline constexpr double kRateApart =
    1.15;  // trains are within ±15 % of the rate (target, against iperf3)

// A loss below one packet of the 10,000 that are averaged is not told from luck.
inline constexpr double kLossFloor = 1e-4;
inline constexpr double kUnmeasured = 0.5;    // chosen: behind the measured, ahead of the down
inline constexpr double kLeastUptime = 0.01;  // chosen: keeps the quotient finite

}  // namespace interneuron::link
