// The arithmetic of symbols over a window: pieces of several messages of different sizes, of which
// each symbol covers those that were of interest when it was made ("Sliding Window Random Linear
// Code (RLC) Forward Erasure Correction (FEC) Schemes for FECFRAME", RFC 8681, is the same with
// random coefficients).
//
// A symbol is the sum of what it covers, each multiplied with the coefficient of its row and
// column; what is shorter than the symbol counts as if zeros followed. Symbols of one window are
// rows of a Cauchy matrix, so that any as many as are missing bring these back. Symbols of windows
// that overlap are combined by Gaussian elimination, which nearly always works as well.
//
// Functions without state and without heap memory. Pure; thread-safe; no errors.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/code/erasure_code.h"

namespace interneuron::code {

// What one symbol may cover: 300 ms of a message of one piece at 100 Hz. RFC 8681 works with
// windows of tens of symbols as well.
inline constexpr std::size_t kMostSources = 32;

// Adds `factor` times `from` to the first bytes of `to`, which is at least as long.
void add_multiple(std::span<std::byte> to, std::span<const std::byte> from, std::uint8_t factor,
                  Kernel kernel = Kernel::kVector);

// Symbols from which all that is known was taken off: what is left is a sum of unknown pieces.
struct Equations {
  // There are so few of both that solving takes some microseconds whatever a peer sends.
  static constexpr std::size_t kMost = 8;
  static constexpr std::size_t kMostUnknown = 16;

  std::size_t count = 0;
  std::size_t unknown = 0;
  // By equation and unknown.
  std::array<std::array<std::uint8_t, kMostUnknown>, kMost> factors{};
};

// An unknown piece is this sum of the equations.
struct Solution {
  std::size_t unknown = 0;
  std::array<std::uint8_t, Equations::kMost> factors{};
};

// Writes those unknowns that the equations tell, and returns how many there are. `out` has room for
// Equations::kMost.
std::size_t solve(Equations equations, std::span<Solution> out);

}  // namespace interneuron::code
