#include "core/code/window.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <vector>

#include "core/code/field.h"

namespace interneuron::code::window_test {
namespace {

using Piece = std::vector<std::byte>;

std::vector<Piece> random_pieces(std::size_t count, std::size_t most, std::mt19937_64& rng) {
  std::vector<Piece> out(count);
  for (Piece& piece : out) {
    piece.resize(1 + rng() % most);
    for (std::byte& b : piece) b = static_cast<std::byte>(rng());
  }
  return out;
}

// A symbol over the pieces from … to - 1.
Piece symbol(const std::vector<Piece>& pieces, std::size_t from, std::size_t to, std::size_t row,
             std::size_t bytes, Kernel kernel = Kernel::kVector) {
  Piece out(bytes);
  for (std::size_t i = from; i < to; ++i) {
    add_multiple(out, pieces[i], coefficient(row, i - from), kernel);
  }
  return out;
}

// What windows bring back of the pieces that are lost.
struct Windows {
  struct Window {
    std::size_t from, to, row;
  };
  std::set<std::size_t> decode(const std::vector<Piece>& pieces, const std::vector<Window>& windows,
                               const std::set<std::size_t>& lost, std::size_t bytes) {
    const std::vector<std::size_t> unknown(lost.begin(), lost.end());
    Equations e{.count = windows.size(), .unknown = unknown.size()};
    std::vector<Piece> sums;
    for (std::size_t w = 0; w < windows.size(); ++w) {
      const auto& [from, to, row] = windows[w];
      sums.push_back(symbol(pieces, from, to, row, bytes));
      for (std::size_t i = from; i < to; ++i) {
        if (!lost.contains(i)) add_multiple(sums[w], pieces[i], coefficient(row, i - from));
      }
      for (std::size_t u = 0; u < unknown.size(); ++u) {
        const bool covers = unknown[u] >= from && unknown[u] < to;
        if (covers) e.factors[w][u] = coefficient(row, unknown[u] - from);
      }
    }
    std::array<Solution, Equations::kMost> solutions;
    std::set<std::size_t> out;
    for (std::size_t s = solve(e, solutions); s-- > 0;) {
      Piece piece(bytes);
      for (std::size_t w = 0; w < windows.size(); ++w) {
        add_multiple(piece, sums[w], solutions[s].factors[w]);
      }
      Piece expected = pieces[unknown[solutions[s].unknown]];
      expected.resize(bytes);
      EXPECT_EQ(piece, expected);
      out.insert(unknown[solutions[s].unknown]);
    }
    return out;
  }
};

TEST(Window, KernelsAgree) {
  std::mt19937_64 rng(1);
  for (const std::size_t size : {1U, 2U, 15U, 16U, 31U, 33U, 64U, 127U, 1400U}) {
    for (int i = 0; i < 50; ++i) {
      const auto pieces = random_pieces(2, size, rng);
      Piece a(size);
      Piece b(size);
      const auto factor = static_cast<std::uint8_t>(rng());
      for (const Piece& piece : pieces) {
        add_multiple(a, piece, factor, Kernel::kVector);
        add_multiple(b, piece, factor, Kernel::kScalar);
      }
      ASSERT_EQ(a, b);
    }
  }
}

TEST(Window, AsManySymbolsAsPiecesAreMissingBringTheseBack) {
  std::mt19937_64 rng(2);
  for (int turn = 0; turn < 500; ++turn) {
    const std::size_t count = 1 + rng() % kMostSources;
    const auto pieces = random_pieces(count, 200, rng);
    const std::size_t missing = 1 + rng() % std::min<std::size_t>(count, Equations::kMost);
    std::set<std::size_t> lost;
    while (lost.size() < missing) lost.insert(rng() % count);
    std::set<std::size_t> rows;
    while (rows.size() < missing) rows.insert(rng() % kMostRows);
    std::vector<Windows::Window> windows;
    for (const std::size_t row : rows) windows.push_back({0, count, row});
    ASSERT_EQ(Windows().decode(pieces, windows, lost, 200), lost);
  }
}

TEST(Window, WindowsThatOverlapAreCombined) {
  std::mt19937_64 rng(3);
  int solved = 0;
  constexpr int kTurns = 500;
  for (int turn = 0; turn < kTurns; ++turn) {
    const auto pieces = random_pieces(12, 100, rng);
    // Two losses in both windows, and a third in one of three.
    const std::set<std::size_t> lost{4 + rng() % 2, 6 + rng() % 2, 9};
    const std::vector<Windows::Window> windows{{0, 8, 1}, {4, 12, 2}, {4, 12, 3}};
    solved += Windows().decode(pieces, windows, lost, 100) == lost ? 1 : 0;
  }
  EXPECT_GE(solved, kTurns * 99 / 100);
}

TEST(Window, WhatIsToldIsSolvedAndTheRestIsNot) {
  std::mt19937_64 rng(4);
  const auto pieces = random_pieces(10, 100, rng);
  // One window has one loss, the other two.
  EXPECT_EQ(Windows().decode(pieces, {{0, 4, 1}, {4, 10, 2}}, {2, 5, 7}, 100),
            (std::set<std::size_t>{2}));
  // Symbols that say the same.
  EXPECT_TRUE(Windows().decode(pieces, {{0, 4, 1}, {0, 4, 1}}, {1, 2}, 100).empty());
  EXPECT_TRUE(Windows().decode(pieces, {}, {1}, 100).empty());
}

}  // namespace
}  // namespace interneuron::code::window_test
