// Nature scores (NOTES §2): how well each link does relative to the best link that is up. Pure.
#pragma once

#include <span>

#include "interneuron/link.h"

namespace interneuron::link {

// Sets `nature` of every link from the other fields:
// - delay: best / this, of RTT p95 / 2 (the one-way queue signal is not measured yet, it counts 0);
// - bandwidth: this / best, of the rate;
// - reliability: best / this, of the loss, which counts as kLossFloor at least;
// - security: 0, until sessions are encrypted.
//
// "best" is over the links that are up; the best one has exactly 1. A link that is down has 0
// everywhere and sets no standard. Scores are ratios: scaling a quantity on all links changes none
// of them.
//
// What was not measured yet on a link that is up (RTT 0, rate 0; the loss has been measured once
// the RTT has) scores kUnmeasured times the lowest score of those measured: behind each of them,
// before nothing. Where no link that is up was measured, all are equal: 1.
void score(std::span<LinkState> links);

inline constexpr double kLossFloor = 1e-4;  // NOTES §2: below it, loss is not told from luck
inline constexpr double kUnmeasured = 0.5;  // chosen: behind the measured, ahead of the down

}  // namespace interneuron::link
