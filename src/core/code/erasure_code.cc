#include "core/code/erasure_code.h"

#include <isa-l/erasure_code.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <functional>

#include "core/code/field.h"

namespace interneuron::code {
namespace {

// Rows that are computed in one pass over the pieces: ISA-L's widest kernel with AVX2.
constexpr std::size_t kRowsAtOnce = 6;
// What ISA-L keeps for one coefficient.
constexpr std::size_t kTableBytes = 32;

using Byte = unsigned char;
Byte* raw(const std::byte* bytes) {
  return const_cast<Byte*>(reinterpret_cast<const Byte*>(bytes));
}

// out[j] = sum over i of coefficients[j * in.size() + i] * in[i], for at most kRowsAtOnce j.
void combine_scalar(std::span<Byte* const> in, std::span<Byte* const> out, std::size_t bytes,
                    const Byte* coefficients) {
  for (std::size_t j = 0; j < out.size(); ++j) {
    std::fill_n(out[j], bytes, Byte{0});
    for (std::size_t i = 0; i < in.size(); ++i) {
      const Byte c = coefficients[j * in.size() + i];
      for (std::size_t b = 0; b < bytes; ++b) {
        out[j][b] = static_cast<Byte>(out[j][b] ^ kField.times(c, in[i][b]));
      }
    }
  }
}

void combine(std::span<Byte* const> in, std::span<Byte* const> out, std::size_t bytes,
             Byte* coefficients, Kernel kernel) {
  assert(out.size() <= kRowsAtOnce && in.size() <= kMostPieces);
  if (kernel == Kernel::kScalar) return combine_scalar(in, out, bytes, coefficients);
  std::array<Byte, kTableBytes * kMostPieces * kRowsAtOnce> tables;
  const int inputs = static_cast<int>(in.size());
  const int rows = static_cast<int>(out.size());
  ec_init_tables(inputs, rows, coefficients, tables.data());
  ec_encode_data(static_cast<int>(bytes), inputs, rows, tables.data(),
                 const_cast<Byte**>(in.data()), const_cast<Byte**>(out.data()));
}

// The coefficients of some rows for some columns, row by row.
template <class Rows, class Columns>
void fill(Byte* out, const Rows& rows, const Columns& columns) {
  for (const std::size_t row : rows) {
    for (const std::size_t column : columns) *out++ = coefficient(row, column);
  }
}

// A list of at most kMostPieces things on the stack.
template <class T>
class Short {
 public:
  void push_back(T t) { items_[size_++] = t; }
  std::size_t size() const { return size_; }
  T operator[](std::size_t i) const { return items_[i]; }
  const T* begin() const { return items_.data(); }
  const T* end() const { return items_.data() + size_; }
  std::span<const T> some(std::size_t from, std::size_t count) const {
    return std::span<const T>(items_.data(), size_).subspan(from, count);
  }

 private:
  std::array<T, kMostPieces> items_{};
  std::size_t size_ = 0;
};

// The inverse of the square matrix that the coefficients of these rows and columns make, which is a
// Cauchy matrix with x = 255 - row and y = column. In closed form (Schechter, "On the Inversion of
// Certain Matrices"), which takes n * n steps instead of n * n * n: a peer that sends tiny pieces
// pays for little more than the matrix.
template <class Rows, class Columns>
void invert(Byte* out, const Rows& rows, const Columns& columns) {
  constexpr std::size_t kOrder = 255;
  const std::size_t n = rows.size();
  const auto log_of = [](std::size_t a, std::size_t b) { return std::size_t{kField.log[a ^ b]}; };
  // The product of the differences of `at` from `others`, divided by that of its differences from
  // its own list; as a logarithm.
  const auto weight = [&](std::size_t at, const auto& others, const auto& own) {
    std::size_t sum = 0;
    for (const std::size_t other : others) sum += log_of(at, other);
    for (const std::size_t other : own) sum += other == at ? 0 : kOrder - log_of(at, other);
    return sum % kOrder;
  };
  Short<std::size_t> x;
  for (const std::size_t row : rows) x.push_back(kOrder - row);
  std::array<std::size_t, kMostRows> of_row;
  for (std::size_t j = 0; j < n; ++j) of_row[j] = weight(x[j], columns, x);
  for (const std::size_t y : columns) {
    const std::size_t of_column = weight(y, x, columns);
    for (std::size_t j = 0; j < n; ++j) {
      *out++ = kField.exp[(of_row[j] + of_column + kOrder - log_of(x[j], y)) % kOrder];
    }
  }
}

}  // namespace

void encode(std::span<const std::byte* const> pieces, std::size_t bytes, std::size_t first_row,
            std::span<std::byte* const> symbols, Kernel kernel) {
  assert(!pieces.empty() && pieces.size() <= kMostPieces && bytes <= kMostBytes);
  assert(first_row + symbols.size() <= kMostRows);
  Short<Byte*> in;
  Short<std::size_t> columns;
  for (std::size_t c = 0; c < pieces.size(); ++c) {
    in.push_back(raw(pieces[c]));
    columns.push_back(c);
  }
  std::array<Byte, kMostPieces * kRowsAtOnce> coefficients;
  for (std::size_t done = 0; done < symbols.size(); done += kRowsAtOnce) {
    const std::size_t now = std::min(kRowsAtOnce, symbols.size() - done);
    Short<Byte*> out;
    Short<std::size_t> rows;
    for (std::size_t j = 0; j < now; ++j) {
      out.push_back(raw(symbols[done + j]));
      rows.push_back(first_row + done + j);
    }
    fill(coefficients.data(), rows, columns);
    combine(in.some(0, in.size()), out.some(0, now), bytes, coefficients.data(), kernel);
  }
}

void decode(std::span<std::byte* const> pieces, std::size_t bytes,
            std::span<const std::uint8_t> missing, std::span<const Symbol> symbols, Kernel kernel) {
  assert(pieces.size() <= kMostPieces && bytes <= kMostBytes);
  assert(symbols.size() == missing.size() && missing.size() <= kMostRows);
  Short<Byte*> there;
  Short<std::size_t> columns;
  Short<std::size_t> wanted;
  Short<Byte*> solved;
  for (std::size_t c = 0; c < pieces.size(); ++c) {
    const bool is_missing = wanted.size() < missing.size() && missing[wanted.size()] == c;
    (is_missing ? wanted : columns).push_back(c);
    (is_missing ? solved : there).push_back(raw(pieces[c]));
  }
  Short<std::size_t> rows;
  Short<Byte*> syndromes;
  for (const Symbol& symbol : symbols) {
    rows.push_back(symbol.row);
    syndromes.push_back(raw(symbol.bytes));
  }
  const std::size_t n = rows.size();

  // What is there is taken off the symbols, which leaves what the missing pieces make of them.
  std::array<Byte, kMostPieces * kRowsAtOnce> coefficients;
  std::array<Byte, kMostBytes * kRowsAtOnce> sums;
  for (std::size_t done = 0; done < n && there.size() > 0; done += kRowsAtOnce) {
    const std::size_t now = std::min(kRowsAtOnce, n - done);
    Short<Byte*> out;
    for (std::size_t j = 0; j < now; ++j) out.push_back(sums.data() + j * kMostBytes);
    fill(coefficients.data(), rows.some(done, now), columns);
    combine(there.some(0, there.size()), out.some(0, now), bytes, coefficients.data(), kernel);
    for (std::size_t j = 0; j < now; ++j) {
      Byte* s = syndromes[done + j];
      std::transform(s, s + bytes, out[j], s, std::bit_xor<>());
    }
  }

  std::array<Byte, kMostRows * kMostRows> inverse;
  invert(inverse.data(), rows, wanted);
  for (std::size_t done = 0; done < n; done += kRowsAtOnce) {
    const std::size_t now = std::min(kRowsAtOnce, n - done);
    combine(syndromes.some(0, n), solved.some(done, now), bytes, inverse.data() + done * n, kernel);
  }
}

}  // namespace interneuron::code
