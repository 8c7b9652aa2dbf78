// Random numbers of the link model. SplitMix64 (Steele, Lea, Flood 2014) both spreads near seeds
// over all 64 bits and is, counted up, a generator of 8 bytes of state: each feature of a link has
// a stream of its own, so that switching one on does not change what another draws. Pure.
#pragma once

#include <cmath>
#include <cstdint>

namespace interneuron::emu {

// One output of SplitMix64.
constexpr std::uint64_t split_mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

class RandomStream {
 public:
  explicit constexpr RandomStream(std::uint64_t seed) : state_(split_mix(seed)) {}

  constexpr std::uint64_t next() {
    const std::uint64_t out = split_mix(state_);
    state_ += 0x9e3779b97f4a7c15U;
    return out;
  }
  // In [0, 1), 53 bits.
  constexpr double uniform() { return static_cast<double>(next() >> 11U) * 0x1.0p-53; }
  // Draws only when something can happen: p = 0 costs nothing.
  constexpr bool chance(double p) { return p > 0 && uniform() < p; }
  double exponential(double mean) { return -mean * std::log1p(-uniform()); }

 private:
  std::uint64_t state_;
};

}  // namespace interneuron::emu
