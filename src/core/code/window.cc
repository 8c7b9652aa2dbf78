#include "core/code/window.h"

#include <isa-l/erasure_code.h>

#include <algorithm>
#include <cassert>
#include <utility>

#include "core/code/field.h"

namespace interneuron::code {
namespace {

// What ISA-L keeps for one coefficient.
constexpr std::size_t kRowTableBytes = 32;

using Combination = std::array<std::uint8_t, Equations::kMost>;

template <class Row>
void scale(Row& row, std::uint8_t factor) {
  for (std::uint8_t& value : row) value = kField.times(value, factor);
}

template <class Row>
void add(Row& to, const Row& from, std::uint8_t factor) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] ^= kField.times(from[i], factor);
}

}  // namespace

void add_multiple(std::span<std::byte> to, std::span<const std::byte> from, std::uint8_t factor,
                  Kernel kernel) {
  assert(from.size() <= to.size());
  if (factor == 0 || from.empty()) return;
  if (kernel == Kernel::kScalar) {
    for (std::size_t i = 0; i < from.size(); ++i) {
      to[i] ^= std::byte{kField.times(factor, std::to_integer<std::uint8_t>(from[i]))};
    }
    return;
  }
  std::array<unsigned char, kRowTableBytes> table;
  ec_init_tables(1, 1, &factor, table.data());
  auto* in = const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(from.data()));
  auto* out = reinterpret_cast<unsigned char*>(to.data());
  ec_encode_data_update(static_cast<int>(from.size()), 1, 1, 0, table.data(), in, &out);
}

// Gauss-Jordan: a row in which one unknown is left tells it.
std::size_t solve(Equations e, std::span<Solution> out) {
  assert(e.count <= Equations::kMost && e.unknown <= Equations::kMostUnknown);
  std::array<Combination, Equations::kMost> sums{};
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i][i] = 1;
  std::size_t rank = 0;
  for (std::size_t u = 0; u < e.unknown && rank < e.count; ++u) {
    std::size_t pivot = rank;
    while (pivot < e.count && e.factors[pivot][u] == 0) ++pivot;
    if (pivot == e.count) continue;
    std::swap(e.factors[pivot], e.factors[rank]);
    std::swap(sums[pivot], sums[rank]);
    const std::uint8_t one = kField.inverse(e.factors[rank][u]);
    scale(e.factors[rank], one);
    scale(sums[rank], one);
    for (std::size_t i = 0; i < e.count; ++i) {
      const std::uint8_t factor = e.factors[i][u];
      if (i == rank || factor == 0) continue;
      add(e.factors[i], e.factors[rank], factor);
      add(sums[i], sums[rank], factor);
    }
    ++rank;
  }
  std::size_t found = 0;
  for (std::size_t i = 0; i < rank; ++i) {
    const auto& row = e.factors[i];
    if (std::ranges::count(row, 0) + 1 != static_cast<std::ptrdiff_t>(row.size())) continue;
    const auto at = std::ranges::find_if(row, [](std::uint8_t value) { return value != 0; });
    out[found++] = {static_cast<std::size_t>(at - row.begin()), sums[i]};
  }
  return found;
}

}  // namespace interneuron::code
