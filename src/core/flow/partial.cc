#include "core/flow/partial.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "core/code/erasure_code.h"

namespace interneuron::flow {

void Partial::begin(const wire::FragmentHeader& f) {
  kind_ = f.kind;
  size_ = f.size;
  chunk_ = f.chunk;
  count_ = f.count();
  missing_ = count_;
  have_.assign(count_, false);
  state_.resize(blocks().blocks());
  for (std::size_t b = 0; b < state_.size(); ++b) {
    state_[b] = {static_cast<std::uint16_t>(blocks().pieces(b)), 0};
  }
  index_.clear();
  symbols_.clear();
  const std::size_t header = std::min<std::size_t>(f.size, wire::header_bytes(f.kind));
  bytes_.header = {};
  for (std::size_t i = 0; i < header; ++i) bytes_.header.push_back(std::byte{0});
  bytes_.payload.reserve(f.size - header);
}

void Partial::end() {
  size_ = 0;
  bytes_ = wire::MessageBytes();
  // Not {}, which a vector takes for an empty list of values, and keeps its memory.
  symbols_ = Bytes();
  scratch_ = Bytes();
  if (count_ <= kMostKept) return;
  have_ = std::vector<bool>();
  state_ = std::vector<Block>();
  index_ = std::vector<StoredSymbol>();
}

bool Partial::has(std::uint16_t index) const {
  if (index < count_) return have_[index];
  return state_[blocks().block_of(index)].missing == 0 ||
         std::ranges::find(index_, index, &StoredSymbol::index) != index_.end();
}

void Partial::add(std::uint16_t index, ByteView bytes) {
  const std::size_t b = blocks().block_of(index);
  Block& block = state_[b];
  if (index < count_) {
    have_[index] = true;
    --block.missing;
    --missing_;
    store(index, bytes);
  } else {
    index_.push_back({index, symbols_.size()});
    symbols_.insert(symbols_.end(), bytes.begin(), bytes.end());
    ++block.symbols;
  }
  if (block.missing > 0 && block.symbols >= block.missing) decode(b);
}

// Only what no fragment has brought yet is ever written, and nothing is read before it is there.
void Partial::store(std::size_t piece, ByteView bytes) {
  std::size_t offset = piece * chunk_;
  wire::MessageBytes::Header& header = bytes_.header;
  if (offset < header.size()) {
    const std::size_t first = std::min(bytes.size(), header.size() - offset);
    std::memcpy(header.data() + offset, bytes.data(), first);
    bytes = bytes.subspan(first);
    offset += first;
  }
  if (bytes.empty()) return;
  Bytes& payload = bytes_.payload;
  const std::size_t at = offset - header.size();
  if (payload.size() < at) payload.resize(at);
  if (payload.size() == at) {
    payload.insert(payload.end(), bytes.begin(), bytes.end());
  } else {
    std::memcpy(payload.data() + at, bytes.data(), bytes.size());
  }
}

void Partial::decode(std::size_t b) {
  const code::Blocks blocks = this->blocks();
  const PieceLayout layout = this->layout();
  const std::size_t columns = blocks.pieces(b);
  // All of the payload is there from now on, so that pieces are written where they belong.
  bytes_.payload.resize(size_ - bytes_.header.size());
  std::array<std::uint8_t, code::kMostPieces> missing;
  std::size_t lost = 0;
  std::size_t odd = 0;
  for (std::size_t c = 0; c < columns; ++c) {
    const std::size_t piece = blocks.piece_at(b, c);
    if (!have_[piece]) missing[lost++] = static_cast<std::uint8_t>(c);
    if (!layout.is_plain(piece)) ++odd;
  }
  scratch_.resize(odd * chunk_);
  std::array<std::byte*, code::kMostPieces> pieces;
  std::byte* room = scratch_.data();
  for (std::size_t c = 0; c < columns; ++c) {
    const std::size_t piece = blocks.piece_at(b, c);
    if (layout.is_plain(piece)) {
      pieces[c] = bytes_.payload.data() + layout.in_payload(piece);
      continue;
    }
    pieces[c] = room;
    room += chunk_;
    if (have_[piece]) layout.load(bytes_, piece, pieces[c]);
  }
  std::array<code::Symbol, code::kMostRows> symbols;
  std::size_t used = 0;
  for (const StoredSymbol& s : index_) {
    if (blocks.block_of(s.index) != b) continue;
    symbols[used++] = {static_cast<std::uint8_t>(blocks.row_of(s.index)), symbols_.data() + s.at};
  }
  code::decode({pieces.data(), columns}, chunk_, {missing.data(), lost}, {symbols.data(), lost});
  for (std::size_t i = 0; i < lost; ++i) {
    const std::size_t piece = blocks.piece_at(b, missing[i]);
    have_[piece] = true;
    if (!layout.is_plain(piece)) store(piece, ByteView(pieces[missing[i]], layout.bytes_of(piece)));
  }
  missing_ -= lost;
  state_[b].missing = 0;
}

}  // namespace interneuron::flow
