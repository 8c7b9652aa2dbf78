// Numbers out of JSON that another process wrote and that may be anything: each is in range or
// throws std::exception. Pure.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

namespace interneuron::watch {

// More than any figure of a link has, in the units of the keys (31 years in ms), and little enough
// that no conversion of it overflows.
constexpr double kMostFigure = 1e12;

// nlohmann's own get() gives whatever a conversion leaves of a number that does not fit.
inline double figure_of(const nlohmann::ordered_json& j) {
  const auto value = j.get<double>();
  if (!(std::abs(value) <= kMostFigure)) throw std::invalid_argument("a figure of no link");
  return value;
}

template <std::integral Integer>
Integer whole_of(const nlohmann::ordered_json& j) {
  if (j.is_number_unsigned() && std::in_range<Integer>(j.get<std::uint64_t>())) {
    return static_cast<Integer>(j.get<std::uint64_t>());
  }
  if (j.is_number_integer() && std::in_range<Integer>(j.get<std::int64_t>())) {
    return static_cast<Integer>(j.get<std::int64_t>());
  }
  throw std::invalid_argument("no whole number that fits");
}

}  // namespace interneuron::watch
