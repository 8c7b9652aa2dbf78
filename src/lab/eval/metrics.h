// Figures of the rounds of all seeds together, and 95 % intervals of what was counted and of what
// was compared seed by seed. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "lab/eval/run.h"

namespace interneuron::eval {

using Interval = std::array<double, 2>;

// Wilson's score interval of `hits` of `n`, as shares; [0, 1] for n = 0.
Interval wilson95(std::uint64_t hits, std::uint64_t n);

// The mean of differences between two systems, one difference per seed.
struct Paired {
  double mean = 0;
  // By Student's t over the seeds; one seed alone has no interval.
  std::optional<Interval> ci95;
};
Paired paired95(std::span<const double> differences);

struct Figures {
  std::uint64_t rounds = 0;
  std::uint64_t timeouts = 0;
  // Shares of the rounds.
  Interval timeouts_ci95{};
  // Rounds missed right after a missed round.
  std::uint64_t consecutive = 0;
  // Over rounds on time; 0 without any.
  double e2e_mean_ms = 0;
  double e2e_p50_ms = 0;
  double e2e_p95_ms = 0;
  double e2e_p99_ms = 0;
  // Means of what the application really got, over all rounds and over those on time.
  double quality = 0;
  double quality_on_time = 0;
  // Bytes of IP by link, both directions together, those of the warm-up included.
  std::vector<double> bytes_per_round;
};
Figures figures(std::span<const Run> runs, const Profile& profile);

}  // namespace interneuron::eval
