#include "core/flow/outgoing_message.h"

#include <array>

#include "core/code/erasure_code.h"
#include "core/flow/piece_layout.h"

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
  const code::Blocks blocks_of = division();
  const PieceLayout layout{bytes.size(), bytes.header.size(), chunk};
  const std::size_t first = blocks[b].rows;
  std::size_t odd = 0;
  for (std::size_t c = 0; c < blocks_of.pieces(b); ++c) {
    if (!layout.is_plain(blocks_of.piece_at(b, c))) ++odd;
  }
  scratch.resize(odd * chunk);
  std::array<const std::byte*, code::kMostPieces> in;
  std::byte* room = scratch.data();
  for (std::size_t c = 0; c < blocks_of.pieces(b); ++c) {
    const std::size_t piece = blocks_of.piece_at(b, c);
    if (layout.is_plain(piece)) {
      in[c] = bytes.payload.data() + layout.in_payload(piece);
      continue;
    }
    layout.load(bytes, piece, room);
    in[c] = room;
    room += chunk;
  }
  const std::size_t end = blocks_of.symbol_at(b, first + how_many - 1) + 1;
  if (pieces.size() < end) pieces.resize(end);
  if (symbols.size() < end - count) symbols.resize(end - count);
  std::array<std::byte*, code::kMostRows> out;
  for (std::size_t row = 0; row < how_many; ++row) {
    Bytes& symbol = symbols[blocks_of.symbol_at(b, first + row) - count];
    symbol.resize(chunk);
    out[row] = symbol.data();
  }
  code::encode({in.data(), blocks_of.pieces(b)}, chunk, first, {out.data(), how_many});
  blocks[b].rows = static_cast<std::uint8_t>(first + how_many);
}

}  // namespace interneuron::flow
