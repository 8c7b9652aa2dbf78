// A message that is being put together from pieces and repair symbols.
#pragma once

#include <cstddef>
#include <cstdint>
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
// The message's whole memory is taken by begin(). A block never keeps more symbols than it misses
// pieces, so all of them never take more than the message. Decoding takes at most a millisecond a
// block, and each block is decoded once, whatever a peer sends; symbols that lie make a wrong
// message, as pieces do that lie. Pure; thread-compatible; never throws but std::bad_alloc.
class Partial {
 public:
  // A new message, of whose pieces this is one. Its memory is used again.
  void begin(const wire::FragmentHeader& fragment);
  // Frees the message's own memory, and what a large one has left beside it.
  void end();

  bool is_open() const { return size_ > 0; }
  // Whether a fragment says of the message what the first one said.
  bool fits(const wire::FragmentHeader& fragment) const {
    return size_ == fragment.size && chunk_ == fragment.chunk && kind_ == fragment.kind;
  }
  // Whether nothing can be learnt from this piece or symbol.
  bool has(std::uint16_t index) const;
  void add(std::uint16_t index, ByteView bytes);
  bool complete() const { return missing_ == 0; }
  // The whole message; ask once it is complete.
  wire::MessageBytes take() { return std::move(bytes_); }

  wire::MessageKind kind() const { return kind_; }
  std::size_t size() const { return size_; }
  // What the message and its symbols hold.
  std::size_t held() const { return size_ + symbols_.size(); }

 private:
  // Pieces for which the memory beside the message is kept for the next one. No measurement behind
  // this value: it only has to be more than common messages have, and little beside 256 messages.
  static constexpr std::size_t kMostKept = 512;

  struct Block {
    std::uint16_t missing = 0;
    std::uint16_t symbols = 0;
  };
  struct StoredSymbol {
    std::uint16_t index = 0;
    // In symbols_.
    std::size_t at = 0;
  };
  code::Blocks blocks() const { return code::Blocks(count_); }
  PieceLayout layout() const { return {size_, bytes_.header.size(), chunk_}; }
  void store(std::size_t piece, ByteView bytes);
  void decode(std::size_t block);

  wire::MessageKind kind_{};
  // Grows with what has come, so that what comes in its order is neither cleared nor copied again.
  wire::MessageBytes bytes_;
  // 0 while there is no message.
  std::size_t size_ = 0;
  std::uint16_t chunk_ = 1;
  std::uint16_t count_ = 0;
  std::size_t missing_ = 0;
  std::vector<bool> have_;
  std::vector<Block> state_;
  std::vector<StoredSymbol> index_;
  Bytes symbols_;
  // Copies of pieces that do not lie in the payload as a whole, while a block is decoded.
  Bytes scratch_;
};

}  // namespace interneuron::flow
