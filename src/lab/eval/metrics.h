// Figures of pooled runs. Pure.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lab/eval/intervals.h"
#include "lab/eval/run.h"

namespace interneuron::eval {

struct Figures {
  std::uint64_t rounds = 0;
  std::uint64_t timeouts = 0;
  Interval timeouts_ci95{};       // shares
  std::uint64_t consecutive = 0;  // rounds missed right after a missed round
  double e2e_mean_ms = 0;         // over rounds on time, as the quantiles
  double e2e_p50_ms = 0;
  double e2e_p95_ms = 0;
  double e2e_p99_ms = 0;
  double quality = 0;                   // mean per round, what the application really got
  double quality_on_time = 0;           // mean over rounds on time
  std::vector<double> bytes_per_round;  // per link, both directions, IP; with the warm-up
};
Figures figures(std::span<const Run> runs, const Profile& profile);

}  // namespace interneuron::eval
