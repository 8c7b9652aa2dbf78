// How a message is divided for coding: its pieces are dealt out to blocks, and each block has
// repair symbols of its own. docs/wire_format.md, "Repair symbols", has the same rule for others.
//
// A code over GF(2^8) has at most 255 pieces and symbols in one block. A message of more pieces
// than kMostPieces has several blocks, dealt out in turns, so that a burst of losses hits all of
// them alike. Which block and row a symbol belongs to follows from its index alone. Plain values;
// pure.
#pragma once

#include <cstddef>
#include <cstdint>

namespace interneuron::code {

// The largest block, and how many repair symbols it may have. 256 KiB are one block, and half a
// second of a link that loses every fifth packet can be made good.
inline constexpr std::size_t kMostPieces = 200;
inline constexpr std::size_t kMostRows = 55;
static_assert(kMostPieces + kMostRows <= 255);

// The blocks of a message of `count` pieces, at least 1. Pieces have the indices 0 … count - 1 and
// symbols those that follow.
class Blocks {
 public:
  explicit constexpr Blocks(std::size_t count)
      : count_(count), blocks_((count + kMostPieces - 1) / kMostPieces) {}

  constexpr std::size_t count() const { return count_; }
  constexpr std::size_t blocks() const { return blocks_; }
  constexpr std::size_t pieces(std::size_t block) const {
    return (count_ - block + blocks_ - 1) / blocks_;
  }
  // The block that a piece or symbol belongs to.
  constexpr std::size_t block_of(std::size_t index) const {
    return (index < count_ ? index : index - count_) % blocks_;
  }
  // The place of a piece in its block, and that of a symbol among the block's symbols.
  constexpr std::size_t column_of(std::size_t piece) const { return piece / blocks_; }
  constexpr std::size_t row_of(std::size_t symbol) const { return (symbol - count_) / blocks_; }
  constexpr std::size_t piece_at(std::size_t block, std::size_t column) const {
    return column * blocks_ + block;
  }
  constexpr std::size_t symbol_at(std::size_t block, std::size_t row) const {
    return count_ + row * blocks_ + block;
  }
  // Indices of pieces and symbols are below this.
  constexpr std::size_t end() const { return count_ + kMostRows * blocks_; }

 private:
  std::size_t count_;
  std::size_t blocks_;
};

}  // namespace interneuron::code
