#include "lab/transports/pieces.h"

#include <algorithm>

namespace interneuron::transports {
namespace {

// Place and number of pieces, half a word each.
constexpr std::uint32_t kHalf = 16;
constexpr std::uint32_t kLowerHalf = 0xffff;
static_assert(kMaxMessageBytes / 1000 < kLowerHalf);

}  // namespace

Pieces::Pieces(const MessageHead& head, std::size_t piece_bytes)
    : message_bytes_(head.bytes),
      share_(piece_bytes - kPieceHeadBytes),
      count_(static_cast<std::uint32_t>((message_bytes_ + share_ - 1) / share_)),
      buffer_(piece_bytes) {
  write_head(buffer_.data(), head);
}

ByteView Pieces::piece(std::uint32_t place) {
  head_detail::put(buffer_.data() + kMessageHeadBytes, place << kHalf | count_);
  const std::size_t share = std::min(share_, message_bytes_ - place * share_);
  return ByteView(buffer_).first(kPieceHeadBytes + share);
}

std::optional<MessageHead> Assembly::take(ByteView piece) {
  if (piece.size() < kPieceHeadBytes) return std::nullopt;
  const MessageHead head = *read_head(piece);
  const std::uint32_t word = head_detail::get(piece.data() + kMessageHeadBytes);
  Partial& partial = messages_[std::uint64_t{head.vehicle} << 32U | head.number];
  if (partial.there.empty()) partial.there.resize(word & kLowerHalf);
  const std::uint32_t place = word >> kHalf;
  if (place >= partial.there.size() || partial.there[place]) return std::nullopt;
  partial.there[place] = true;
  return ++partial.count == partial.there.size() ? std::optional(head) : std::nullopt;
}

}  // namespace interneuron::transports
