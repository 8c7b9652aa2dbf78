// SplitMix64 (Steele et al., Fast Splittable Pseudorandom Number Generators, 2014): numbers that
// look like drawn ones, for what only has to differ from one endpoint to the next. Whoever knows
// the seed knows them all, so they keep no secret.
#pragma once

#include <cstdint>

namespace interneuron {

// The next number; `state` may begin with anything.
constexpr std::uint64_t split_mix(std::uint64_t& state) {
  state += 0x9e3779b97f4a7c15;
  std::uint64_t z = state;
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111eb;
  return z ^ (z >> 31U);
}

// The next number as a part of one: at least 0, less than 1.
constexpr double split_mix_part(std::uint64_t& state) {
  return static_cast<double>(split_mix(state) >> 40U) / static_cast<double>(1U << 24U);
}

}  // namespace interneuron
