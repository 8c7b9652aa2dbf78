// Arithmetic of the field that all codes here use: GF(2^8) with the polynomial
// x^8 + x^4 + x^3 + x^2 + 1, whose sum is the exclusive or; and the coefficients that symbols have.
//
// A table of logarithms, made when the program is compiled. Pure; thread-safe; no errors.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace interneuron::code {

struct Field {
  std::array<std::uint8_t, 510> exp{};
  std::array<std::uint8_t, 256> log{};
  constexpr Field() {
    constexpr unsigned kPolynomial = 0x11d;
    unsigned x = 1;
    for (unsigned i = 0; i < 255; ++i) {
      exp[i] = exp[i + 255] = static_cast<std::uint8_t>(x);
      log[x] = static_cast<std::uint8_t>(i);
      x <<= 1U;
      if (x > 255) x ^= kPolynomial;
    }
  }
  constexpr std::uint8_t times(std::uint8_t a, std::uint8_t b) const {
    return a == 0 || b == 0 ? std::uint8_t{0} : exp[std::size_t{log[a]} + log[b]];
  }
  // 0 has no inverse and may not be asked for.
  constexpr std::uint8_t inverse(std::uint8_t a) const { return exp[255U - log[a]]; }
};
inline constexpr Field kField;

// What row `row` of the symbols multiplies column `column` with: 1 / ((255 - row) + column).
// Columns count from 0 up and rows from 255 down, so that they never meet.
constexpr std::uint8_t coefficient(std::size_t row, std::size_t column) {
  return kField.inverse(static_cast<std::uint8_t>((255U - row) ^ column));
}

}  // namespace interneuron::code
