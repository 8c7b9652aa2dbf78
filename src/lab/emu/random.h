// Random numbers of the link model: each feature of a link has a stream of its own, so that
// switching one on does not change what another draws. Pure.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/base/split_mix.h"

namespace interneuron::emu {

using interneuron::split_mix;

class RandomStream {
 public:
  explicit constexpr RandomStream(std::uint64_t seed) : state_(split_mix(seed)) {}

  constexpr std::uint64_t next() { return next_split_mix(state_); }
  // In [0, 1), 53 bits.
  constexpr double uniform() { return part_of_one(next()); }
  // Draws only when something can happen: p = 0 costs nothing.
  constexpr bool chance(double p) { return p > 0 && uniform() < p; }
  double exponential(double mean) { return -mean * std::log1p(-uniform()); }

 private:
  std::uint64_t state_;
};

}  // namespace interneuron::emu
