#include "core/code/erasure_code.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace interneuron::code::erasure_code_test {
namespace {

using Piece = std::vector<std::byte>;

struct Block {
  std::size_t bytes = 0;
  std::vector<Piece> pieces;

  Block(std::size_t count, std::size_t size, std::mt19937_64& rng) : bytes(size) {
    for (std::size_t i = 0; i < count; ++i) {
      Piece piece(size);
      for (std::byte& b : piece) b = static_cast<std::byte>(rng());
      pieces.push_back(std::move(piece));
    }
  }
  std::vector<Piece> symbols(std::size_t first, std::size_t rows, Kernel kernel) const {
    std::vector<Piece> out(rows, Piece(bytes));
    std::vector<const std::byte*> in;
    for (const Piece& p : pieces) in.push_back(p.data());
    std::vector<std::byte*> to;
    for (Piece& p : out) to.push_back(p.data());
    encode(in, bytes, first, to, kernel);
    return out;
  }
};

// Loses `lost` pieces and brings them back by as many symbols of any rows.
void check(std::size_t count, std::size_t size, std::size_t lost, Kernel kernel,
           std::uint64_t seed) {
  std::mt19937_64 rng(seed);
  const Block block(count, size, rng);
  std::vector<Piece> symbols = block.symbols(0, kMostRows, kernel);
  std::vector<std::uint8_t> missing(count);
  for (std::size_t i = 0; i < count; ++i) missing[i] = static_cast<std::uint8_t>(i);
  std::shuffle(missing.begin(), missing.end(), rng);
  missing.resize(lost);
  std::sort(missing.begin(), missing.end());
  std::vector<std::uint8_t> rows(kMostRows);
  for (std::size_t i = 0; i < kMostRows; ++i) rows[i] = static_cast<std::uint8_t>(i);
  std::shuffle(rows.begin(), rows.end(), rng);
  std::vector<Symbol> use;
  for (std::size_t i = 0; i < lost; ++i) use.push_back({rows[i], symbols[rows[i]].data()});
  std::vector<Piece> there = block.pieces;
  for (const std::uint8_t m : missing) there[m].assign(size, std::byte{0xee});
  std::vector<std::byte*> to;
  for (Piece& p : there) to.push_back(p.data());
  decode(to, size, missing, use, kernel);
  EXPECT_EQ(there, block.pieces) << count << " pieces of " << size << ", " << lost << " lost, seed "
                                 << seed;
}

// With full pieces five times for the kernel that is in use, and once with short ones for the
// other, which is slow. Each time takes the next seed.
void check_often(std::size_t count, std::size_t lost, Kernel kernel, std::uint64_t& seed) {
  const bool is_usual = kernel == Kernel::kVector;
  for (int i = 0; i < (is_usual ? 5 : 1); ++i) {
    check(count, is_usual ? 1347 : 100, lost, kernel, seed++);
  }
}

TEST(ErasureCode, AnySymbolsBringBackAsManyPieces) {
  std::uint64_t seed = 1;
  for (const Kernel kernel : {Kernel::kVector, Kernel::kScalar}) {
    for (const std::size_t count : {1UL, 2UL, 7UL, 98UL, 200UL}) {
      for (const std::size_t lost : {1UL, 2UL, 5UL, 6UL, 7UL, 13UL, 55UL}) {
        if (lost > count) continue;
        check_often(count, lost, kernel, seed);
      }
    }
  }
}

TEST(ErasureCode, AnySizeOfPieces) {
  for (std::size_t size = 1; size < 200; ++size) check(9, size, 4, Kernel::kVector, size);
  check(9, kMostBytes, 4, Kernel::kVector, 1);
}

TEST(ErasureCode, TheKernelsAgreeToTheByte) {
  std::mt19937_64 rng(3);
  for (const std::size_t count : {1UL, 5UL, 98UL, 200UL}) {
    const Block block(count, 333, rng);
    EXPECT_EQ(block.symbols(0, 20, Kernel::kVector), block.symbols(0, 20, Kernel::kScalar));
  }
}

TEST(ErasureCode, LaterRowsAreThoseOfALongerCode) {
  std::mt19937_64 rng(4);
  const Block block(50, 100, rng);
  const std::vector<Piece> all = block.symbols(0, 20, Kernel::kVector);
  const std::vector<Piece> later = block.symbols(7, 13, Kernel::kVector);
  EXPECT_TRUE(std::equal(later.begin(), later.end(), all.begin() + 7));
}

// What other implementations have to reproduce: docs/wire_format.md, "Repair symbols".
TEST(ErasureCode, TheExampleOfTheWireFormat) {
  const std::vector<Piece> pieces{{std::byte{0x01}, std::byte{0x02}},
                                  {std::byte{0x10}, std::byte{0x20}}};
  std::vector<Piece> symbols(2, Piece(2));
  const std::vector<const std::byte*> in{pieces[0].data(), pieces[1].data()};
  const std::vector<std::byte*> out{symbols[0].data(), symbols[1].data()};
  encode(in, 2, 0, out);
  std::vector<Piece> scalar(2, Piece(2));
  const std::vector<std::byte*> out2{scalar[0].data(), scalar[1].data()};
  encode(in, 2, 0, out2, Kernel::kScalar);
  EXPECT_EQ(symbols, scalar);
  // 1 / 255 = 0xfd and 1 / 254 = 0x7e.
  const auto bytes = [](int a, int b) {
    return Piece{static_cast<std::byte>(a), static_cast<std::byte>(b)};
  };
  EXPECT_EQ(symbols, (std::vector<Piece>{bytes(0x4e, 0x9c), bytes(0x15, 0x2a)}));
}

}  // namespace
}  // namespace interneuron::code::erasure_code_test
