// Figures of pooled runs. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "lab/eval/run.h"

namespace interneuron::eval {

// Percentile by nearest rank, q in (0, 1]; 0 when there is nothing.
double percentile(std::vector<double> values, double q);

// Wilson score interval of `hits` of `n` (95 %), as shares.
// n = 0: [0, 1].
std::array<double, 2> wilson95(std::uint64_t hits, std::uint64_t n);

struct Figures {
  std::uint64_t rounds = 0;
  std::uint64_t timeouts = 0;
  std::array<double, 2> timeouts_ci95{};  // shares
  std::uint64_t consecutive = 0;          // rounds missed right after a missed round
  double e2e_mean_ms = 0;                 // over rounds on time, as the quantiles
  double e2e_p50_ms = 0;
  double e2e_p95_ms = 0;
  double e2e_p99_ms = 0;
  double quality = 0;                   // mean per round, what the application really got
  double quality_on_time = 0;           // mean over rounds on time
  std::vector<double> bytes_per_round;  // per link, both directions, IP; with the warm-up
};
Figures figures(std::span<const Run> runs, const Profile& profile);

}  // namespace interneuron::eval
