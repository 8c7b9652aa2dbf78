// 95 % intervals of what was counted and of what was compared seed by seed. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

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

}  // namespace interneuron::eval
