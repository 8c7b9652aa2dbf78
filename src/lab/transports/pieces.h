// Messages in pieces, for transports that carry datagrams and leave it to the application to cut
// messages and to put them together. Plain values; pure; thread-compatible; no errors: what makes
// no sense is dropped.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "lab/transports/message_head.h"

namespace interneuron::transports {

// Every piece begins with the head of its message, its own place in it, and the number of pieces
// that the message has.
inline constexpr std::size_t kPieceHeadBytes = kMessageHeadBytes + 4;

// The pieces of one message, of zeros but for their heads, each at most `piece_bytes` long.
class Pieces {
 public:
  Pieces(const MessageHead& head, std::size_t piece_bytes);
  std::uint32_t count() const { return count_; }
  // The bytes of that piece, until the next call.
  ByteView piece(std::uint32_t place);

 private:
  std::size_t message_bytes_;
  std::size_t share_;
  std::uint32_t count_;
  Bytes buffer_;
};

// Puts messages together from pieces that come in any order and more than once. Memory: a bit for
// each piece of the run, so that copies of what is whole are known.
class Assembly {
 public:
  // Takes a piece; tells the message that is whole by it.
  std::optional<MessageHead> take(ByteView piece);

 private:
  struct Partial {
    std::vector<bool> there;
    std::size_t count = 0;
  };
  // By vehicle and number.
  std::unordered_map<std::uint64_t, Partial> messages_;
};

}  // namespace interneuron::transports
