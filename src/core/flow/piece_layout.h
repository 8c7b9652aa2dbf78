// Where the pieces of a message lie in its bytes, as codes want them: each with `chunk` bytes, the
// last one as if zeros followed it. Both ends use it. Views into the message; pure.
#pragma once

#include <algorithm>
#include <cstddef>

#include "core/wire/message_bytes.h"

namespace interneuron::flow {

struct PieceLayout {
  // Of the message, and of its header.
  std::size_t size = 0;
  std::size_t header = 0;
  std::size_t chunk = 1;

  std::size_t bytes_of(std::size_t piece) const { return std::min(chunk, size - piece * chunk); }
  // Whether a piece lies in the payload as a whole, with `chunk` bytes, and then where.
  bool is_plain(std::size_t piece) const {
    return piece * chunk >= header && bytes_of(piece) == chunk;
  }
  // How many pieces do not: those that begin in the header, and the last one if it is shorter.
  std::size_t odd() const {
    const std::size_t count = (size + chunk - 1) / chunk;
    return std::min(count, (header + chunk - 1) / chunk + (size % chunk != 0 ? 1 : 0));
  }
  std::size_t in_payload(std::size_t piece) const { return piece * chunk - header; }
  // Copies a piece to `chunk` bytes.
  void load(const wire::MessageBytes& message, std::size_t piece, std::byte* to) const {
    const auto part = message.part(piece * chunk, bytes_of(piece));
    to = std::copy(part.header.begin(), part.header.end(), to);
    to = std::copy(part.payload.begin(), part.payload.end(), to);
    std::fill_n(to, chunk - part.size(), std::byte{0});
  }
};

}  // namespace interneuron::flow
