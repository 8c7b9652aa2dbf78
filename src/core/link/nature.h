// Nature scores: how well each link does relative to the best link that is up (docs/paper.md,
// "Nature"). Pure; no allocation.
#pragma once

#include <compare>
#include <cstdint>
#include <span>

#include "interneuron/link.h"

namespace interneuron::link {

// Sets `nature` of every link from its other fields:
//
// - delay: best / this of half the p95 of the round trip plus queue_up, because messages go up; the
//   queue of the downlink is part of the round trip;
// - bandwidth: this / best of the rate;
// - reliability: best / this of the loss (kLossFloor at least) divided by the share of time not in
//   outage (kLeastUptime at least);
// - security: 0 in the clear on a foreign network, 0.5 encrypted or on a trusted one, 1 for both
//
// "Best" is the best of the links that are up, which has exactly 1. A link that is down has 0
// everywhere and is not compared with. Scores are ratios: scaling a quantity on all links changes
// none of them.
//
// Evidence that has lost confidence counts as worse than measured, by 1 / (1/2 + confidence/2): at
// worst as half as good, which is where unmeasured links begin.
//
// A quantity that was not measured yet on a link that is up (round trip 0, rate 0; the loss is
// measured once the round trip is) scores kUnmeasured times the lowest score of the measured links,
// so that such a link ranks behind each of them but above those that are down. When no link that is
// up was measured, all score 1.
void score(std::span<LinkState> links);

// How much evidence of this age is worth: 1 while it is no older than `grace`, then half as much
// with every `half_life`; 0 for Duration::max(), which means never.
double confidence(Duration age, Duration grace, Duration half_life);
// For everything but the rate. Idle heartbeats come every 300 ms, so that up to three missing ones
// are no news; a radio's bad episodes begin within seconds (docs/constants.md, "Three-state
// model").
inline constexpr Duration kGrace = std::chrono::seconds(1);
inline constexpr Duration kHalfLife = std::chrono::seconds(5);
// For the rate: trains on an idle link come every 10 s (ProbeSchedule), and the rate changes with
// the place and the load of the cell, in tens of seconds. No measurement behind the half-life: it
// only has to be larger than a few intervals of trains.
inline constexpr Duration kRateGrace = std::chrono::seconds(12);
inline constexpr Duration kRateHalfLife = std::chrono::seconds(30);

// Why a link has a score: its quantity and the best one that it was compared with, both made worse
// by their age; 0 when nothing was measured.
struct Reason {
  double value = 0;
  double best = 0;
  // In [0, 1].
  double confidence = 0;
  bool measured = false;
};
struct Evidence {
  // In seconds.
  Reason delay;
  // In bits per second.
  Reason bandwidth;
  // The share of packets lost, divided by the share of time not in outage.
  Reason reliability;
  bool trusted = false;
  bool encrypted = false;
};
// `links` are those that `link` was scored among.
Evidence explain(const LinkState& link, std::span<const LinkState> links);

enum class Field : std::uint8_t { kDelay, kBandwidth, kReliability };
// Whether what was measured tells two links apart on a field: `greater` when a is better, `less`
// when b is, `unordered` when one is not measured or chance may explain the difference; never
// `equivalent`. They are told apart by
//
// - delay, when half the p95 of the round trip plus queue_up differs by more than 1.64 standard
//   errors of both and by more than 2 %, and the smallest round trips agree, so that a queue of our
//   own making on the better link decides nothing. The standard error of a link is
//   2.1 sd / sqrt(rtt_samples) with sd = 1.25 RTTVAR / 2, which is that of the p95 of normal
//   values;
// - bandwidth, when the ratio of the rates is above kRateApart, both from trains of full length;
// - reliability, when the losses differ by more than 1.64 standard errors of both, each of them
//   sqrt(p (1 - p) (2 burst - 1) / loss_packets) with p as if one more packet had been lost.
std::partial_ordering compare(const LinkState& a, const LinkState& b, Field field);
// Rates from trains are meant to be within ±15 % of what iperf3 measures.
inline constexpr double kRateApart = 1.15;

// A loss below one packet of the 10,000 that are averaged is not told from luck.
inline constexpr double kLossFloor = 1e-4;
// No measurement behind these values. The first only has to lie between 0, the score of a link that
// is down, and 1, that of the worst measured one; the second keeps a quotient finite.
inline constexpr double kUnmeasured = 0.5;
inline constexpr double kLeastUptime = 0.01;

}  // namespace interneuron::link
