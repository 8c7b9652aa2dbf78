// SplitMix64 (Steele et al., Fast Splittable Pseudorandom Number Generators, 2014): it spreads near
// numbers over all 64 bits, and counted up it is a generator of 8 bytes of state. For what only has
// to differ from one endpoint to the next, and for models. Whoever knows a number knows all that
// follow, so they keep no secret.
#pragma once

#include <cstdint>

namespace interneuron {

inline constexpr std::uint64_t kSplitMixStep = 0x9e3779b97f4a7c15U;

// One output.
constexpr std::uint64_t split_mix(std::uint64_t x) {
  x += kSplitMixStep;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

// The next output of a generator, whose state may begin with anything.
constexpr std::uint64_t next_split_mix(std::uint64_t& state) {
  const std::uint64_t out = split_mix(state);
  state += kSplitMixStep;
  return out;
}

// A number as a part of one: at least 0, less than 1, in steps of a double's 53 bits.
constexpr double part_of_one(std::uint64_t number) {
  return static_cast<double>(number >> 11U) * 0x1.0p-53;
}

}  // namespace interneuron
