// Figures of a sample that every group needs. Pure functions without state; they take their values
// by copy or by view and keep nothing.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

namespace interneuron {

// The q-th percentile by nearest rank: the smallest value that at least the share q of all values
// does not exceed, q in (0, 1]. An empty sample gives T{}.
template <class T = double>
T percentile(std::vector<T> values, double q) {
  if (values.empty()) return T{};
  const auto rank =
      static_cast<std::size_t>(std::max(1.0, std::ceil(q * static_cast<double>(values.size()))));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(rank - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

// The arithmetic mean, summed in the order of the values; 0 for an empty sample.
inline double mean(std::span<const double> values) {
  if (values.empty()) return 0;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace interneuron
