#include "lab/foreign/stream_receiver.h"

namespace interneuron::foreign {

void StreamReceiver::read(const Piece& piece) {
  next_ += piece.bytes;
  if (piece.ends_message) whole_.push_back(piece.message);
}

void StreamReceiver::add(const Piece& piece) {
  // Pieces are never cut anew, so that one is either read already, next, or behind a gap.
  if (piece.offset > next_) waiting_.emplace(piece.offset, piece);
  if (piece.offset != next_) return;
  read(piece);
  while (!waiting_.empty() && waiting_.begin()->first <= next_) {
    const Piece behind = waiting_.begin()->second;
    waiting_.erase(waiting_.begin());
    if (behind.offset == next_) read(behind);
  }
}

std::optional<std::uint32_t> StreamReceiver::poll_message() {
  if (whole_.empty()) return std::nullopt;
  const std::uint32_t message = whole_.front();
  whole_.pop_front();
  return message;
}

}  // namespace interneuron::foreign
