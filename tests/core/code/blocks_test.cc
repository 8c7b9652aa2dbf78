#include "core/code/blocks.h"

#include <gtest/gtest.h>

#include <set>

namespace interneuron::code::blocks_test {
namespace {

TEST(Blocks, EveryPieceAndSymbolHasOnePlace) {
  for (const std::size_t count : {1UL, 2UL, 199UL, 200UL, 201UL, 400UL, 401UL, 6227UL}) {
    const Blocks blocks(count);
    std::set<std::size_t> seen;
    for (std::size_t b = 0; b < blocks.blocks(); ++b) {
      ASSERT_LE(blocks.pieces(b), kMostPieces);
      ASSERT_GT(blocks.pieces(b), 0U);
      for (std::size_t c = 0; c < blocks.pieces(b); ++c) {
        const std::size_t piece = blocks.piece_at(b, c);
        ASSERT_LT(piece, count);
        EXPECT_EQ(blocks.block_of(piece), b);
        EXPECT_EQ(blocks.column_of(piece), c);
        EXPECT_TRUE(seen.insert(piece).second);
      }
      for (std::size_t r = 0; r < kMostRows; ++r) {
        const std::size_t symbol = blocks.symbol_at(b, r);
        ASSERT_LT(symbol, blocks.end());
        EXPECT_EQ(blocks.block_of(symbol), b);
        EXPECT_EQ(blocks.row_of(symbol), r);
        EXPECT_TRUE(seen.insert(symbol).second);
      }
    }
    EXPECT_EQ(seen.size(), blocks.end());
  }
}

TEST(Blocks, ABurstHitsAllAlike) {
  const Blocks blocks(1000);
  ASSERT_EQ(blocks.blocks(), 5U);
  std::vector<int> hit(5);
  for (std::size_t i = 100; i < 120; ++i) ++hit[blocks.block_of(i)];
  EXPECT_EQ(hit, (std::vector<int>{4, 4, 4, 4, 4}));
}

}  // namespace
}  // namespace interneuron::code::blocks_test
