#include "core/flow/outgoing_message.h"

#include <array>

#include "core/code/erasure_code.h"

namespace interneuron::flow {

wire::FragmentHeader OutgoingMessage::fragment(std::size_t index) const {
  return {id,          static_cast<std::uint16_t>(index),
          chunk,       static_cast<std::uint32_t>(bytes.size()),
          lifetime_us, kind};
}

wire::MessageBytes::Part OutgoingMessage::part(std::size_t index) const {
  if (index >= count) return {{}, ByteView(symbols[index - count])};
  const std::size_t offset = index * chunk;
  return bytes.part(offset, std::min<std::size_t>(chunk, bytes.size() - offset));
}

void OutgoingMessage::make_symbols(std::size_t b, std::size_t how_many, Bytes& scratch) {
  const code::Blocks all = division();
  const std::size_t first = blocks[b].rows;
  // What does not lie in the payload as a whole is copied, and what is shorter filled with zeros.
  const auto is_odd = [this](std::size_t piece) {
    return piece * chunk < bytes.header.size() || part(piece).size() < chunk;
  };
  std::size_t odd = 0;
  for (std::size_t c = 0; c < all.pieces(b); ++c) odd += is_odd(all.piece_at(b, c)) ? 1 : 0;
  scratch.resize(odd * chunk);
  std::array<const std::byte*, code::kMostPieces> in;
  std::byte* room = scratch.data();
  for (std::size_t c = 0; c < all.pieces(b); ++c) {
    const wire::MessageBytes::Part it = part(all.piece_at(b, c));
    in[c] = it.payload.data();
    if (!is_odd(all.piece_at(b, c))) continue;
    in[c] = room;
    room = std::ranges::copy(it.header, room).out;
    room = std::ranges::copy(it.payload, room).out;
    room = std::fill_n(room, chunk - it.size(), std::byte{0});
  }
  const std::size_t end = all.symbol_at(b, first + how_many - 1) + 1;
  if (pieces.size() < end) pieces.resize(end);
  if (symbols.size() < end - count) symbols.resize(end - count);
  std::array<std::byte*, code::kMostRows> out;
  for (std::size_t row = 0; row < how_many; ++row) {
    Bytes& symbol = symbols[all.symbol_at(b, first + row) - count];
    symbol.resize(chunk);
    out[row] = symbol.data();
  }
  code::encode({in.data(), all.pieces(b)}, chunk, first, {out.data(), how_many});
  blocks[b].rows = static_cast<std::uint8_t>(first + how_many);
}

}  // namespace interneuron::flow
