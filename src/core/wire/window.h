// Repair symbols of a window: which pieces of which messages one covers, and how a piece is a part
// of it. docs/wire_format.md, "Window (type 6)", has the same for others.
//
// Plain values and functions; pure. What the functions that read do not refuse is within all
// bounds.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <optional>
#include <span>

#include "core/code/window.h"
#include "core/wire/bytes.h"
#include "interneuron/few.h"
#include "interneuron/message.h"
#include "interneuron/units.h"

namespace interneuron::wire {

// A message that a symbol covers has at most so many pieces: what one byte tells of.
inline constexpr std::size_t kMostWindowPieces = 8;
// Messages that one symbol covers: at most 300 ms of one at 50 Hz.
inline constexpr std::size_t kMostWindowMessages = 16;
// The number of a message is told as the difference from the one before it.
inline constexpr std::uint32_t kMostAhead = 255;
// What stands before the coded bytes when so many messages are covered.
constexpr std::size_t window_header_bytes(std::size_t messages) { return 5 + 2 * messages; }
// What a piece begins with as a part of a symbol: what its packet says of the message.
inline constexpr std::size_t kSourceHeaderBytes = 11;

// The column of a piece, the same in each symbol that covers it: so symbols of windows that overlap
// are parts of one Cauchy matrix. Messages whose numbers differ by a multiple of kColumnMessages
// share columns; two losses in the same one need a symbol that covers but one of them.
inline constexpr std::uint32_t kColumnMessages = code::kMostPieces / kMostWindowPieces;
constexpr std::size_t window_column(MessageId message, std::uint8_t index) {
  return message.value % kColumnMessages * kMostWindowPieces + index;
}

struct WindowHeader {
  struct Covered {
    MessageId message{};
    // Bit i: piece i; not 0.
    std::uint8_t pieces = 0;
    friend bool operator==(const Covered&, const Covered&) = default;
  };
  // Below code::kMostRows.
  std::uint8_t row = 0;
  // In rising order of their numbers, modulo 2^32; at least one. All of them have at most
  // code::kMostSources pieces that are covered.
  Few<Covered, kMostWindowMessages> messages;

  std::size_t sources() const {
    std::size_t sum = 0;
    for (const Covered& c : messages) sum += static_cast<std::size_t>(std::popcount(c.pieces));
    return sum;
  }
  // Calls `what` with the column, message and index of each piece that is covered.
  template <class What>
  void for_each(const What& what) const {
    for (const Covered& c : messages) {
      for (std::uint8_t i = 0; i < kMostWindowPieces; ++i) {
        if ((c.pieces >> i & 1U) != 0) what(window_column(c.message, i), c.message, i);
      }
    }
  }
  friend bool operator==(const WindowHeader&, const WindowHeader&) = default;
};

struct Window {
  WindowHeader header;
  // Points into the parsed datagram.
  ByteView bytes;
};

void put_window(Writer& w, const WindowHeader& header);
// Reads a whole body.
std::optional<Window> get_window(Reader& r);

}  // namespace interneuron::wire
