// A message that is being put together from pieces and repair symbols.
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "core/code/blocks.h"
#include "core/flow/piece_layout.h"
#include "core/wire/message_bytes.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Takes the pieces and symbols of one message in any order and decodes a block as soon as it has as
// many symbols as pieces are missing. Reassembler owns a number of them, uses each for one message
// after the other, and checks before that what comes is valid and fits the message.
//
// A symbol waits in the place of a piece that is missing, and moves to another such place when that
// piece comes. There is always one, since a block is decoded before it has more symbols than
// missing pieces. So whatever comes, a message takes what held_by() says and nothing else, and no
// symbol finds no room. Decoding takes at most a millisecond a block and, while it lasts, a copy of
// the block's symbols; each block is decoded once, whatever a peer sends. Symbols that lie make a
// wrong message, as pieces do that lie. Pure; thread-compatible; never throws but std::bad_alloc.
class Partial {
 public:
  // What a message takes from begin() to end(), in bytes: its own, what is kept beside them, and
  // the places of symbols for which its own bytes do not suffice.
  static std::size_t held_by(const wire::FragmentHeader& fragment);

  // A new message, of whose pieces this is one.
  void begin(const wire::FragmentHeader& fragment);
  // Frees the message's memory but for some hundred bytes beside it, which the next one uses again.
  void end();

  bool is_open() const { return size_ > 0; }
  // Whether a fragment says of the message what the first one said.
  bool fits(const wire::FragmentHeader& fragment) const {
    return size_ == fragment.size && chunk_ == fragment.chunk && kind_ == fragment.kind;
  }
  // Whether nothing can be learnt from this piece or symbol.
  bool has(std::uint16_t index) const;
  // One that is not there yet; a symbol of at most code::kMostBytes.
  void add(std::uint16_t index, ByteView bytes);
  bool complete() const { return missing_ == 0; }
  // The whole message; ask once it is complete.
  wire::MessageBytes take() { return std::move(bytes_); }

  wire::MessageKind kind() const { return kind_; }
  std::size_t size() const { return size_; }
  // What held_by() says of the message; 0 where there is none.
  std::size_t held() const { return held_; }

 private:
  // Where a symbol waits: the column of the missing piece in whose place it is or, from here on, a
  // place in spare_.
  static constexpr std::size_t kFirstSpare = code::kMostPieces;
  // Of a message whose pieces are of one byte, those in the header, and the last one.
  static constexpr std::size_t kMostSpare = wire::MessageBytes::kMostHeaderBytes + 1;

  struct Block {
    // Pieces that are not there, and symbols that wait; always fewer than these.
    std::uint8_t missing = 0;
    std::uint8_t symbols = 0;
    // Of the symbols that wait: their rows, and where they are.
    std::array<std::uint8_t, code::kMostRows> rows;
    std::array<std::uint16_t, code::kMostRows> places;
  };
  // A symbol that is in no place.
  struct Loose {
    std::uint8_t row = 0;
    ByteView bytes;
  };
  code::Blocks blocks() const { return code::Blocks(count_); }
  PieceLayout layout() const { return {size_, bytes_.header.size(), chunk_}; }
  static std::size_t spare_places(const PieceLayout& layout);
  void add_piece(std::size_t block, std::size_t piece, ByteView bytes);
  void store(std::size_t piece, ByteView bytes);
  std::byte* place(std::size_t block, std::size_t place);
  std::size_t free_place(std::size_t block) const;
  void keep(std::size_t block, const Loose& symbol);
  Loose let_go(std::size_t block, std::size_t symbol, std::span<std::byte> copy);
  void decode(std::size_t block, const std::optional<Loose>& newest);

  wire::MessageKind kind_{};
  // Grows with what has come, so that what comes in its order is neither cleared nor copied again.
  wire::MessageBytes bytes_;
  // 0 while there is no message.
  std::size_t size_ = 0;
  std::size_t held_ = 0;
  std::uint16_t chunk_ = 1;
  std::uint16_t count_ = 0;
  std::size_t missing_ = 0;
  std::vector<bool> have_;
  std::vector<Block> state_;
  // Places beside the message, of `chunk_` bytes each, and which of them are taken. There are none
  // before the first symbol that needs one.
  Bytes spare_;
  std::bitset<kMostSpare> taken_;
};

// A Reassembler's places move when it grows; what is copied loses the memory reserved for it.
static_assert(std::is_nothrow_move_constructible_v<Partial>);

}  // namespace interneuron::flow
