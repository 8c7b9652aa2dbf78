// A connection's ordered byte stream at the receiver: pieces come in any order and perhaps twice,
// and the application reads what is there without a gap. A message is there when all of it, and of
// every message before it, can be read: the head of the line blocks. Memory: one entry per piece
// that waits behind a gap. Pure; thread-compatible; no errors.
#pragma once

#include <cstdint>
#include <map>
#include <optional>

#include "core/base/ring.h"
#include "lab/foreign/segment.h"

namespace interneuron::foreign {

class StreamReceiver {
 public:
  void add(const Piece& piece);
  // The next message that can be read whole, in their order.
  std::optional<std::uint32_t> poll_message();
  std::uint64_t readable_bytes() const { return next_; }

 private:
  void read(const Piece& piece);

  std::uint64_t next_ = 0;
  // By offset.
  std::map<std::uint64_t, Piece> waiting_;
  Ring<std::uint32_t> whole_;
};

}  // namespace interneuron::foreign
