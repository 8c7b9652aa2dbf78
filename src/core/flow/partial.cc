#include "core/flow/partial.h"

#include <algorithm>
#include <cassert>
#include <cstring>

#include "core/code/erasure_code.h"

namespace interneuron::flow {
namespace {

// Pieces for which the memory beside the message is kept for the next one: those of 690 KB, which
// is 0.6 KB. No measurement behind this value: it only has to be more than common messages have,
// and little beside what a Reassembler keeps for each message at a time.
constexpr std::size_t kMostKept = 512;
constexpr std::size_t kBitsPerByte = 8;

std::size_t header_of(const wire::FragmentHeader& f) {
  return std::min<std::size_t>(f.size, wire::header_bytes(f.kind));
}

}  // namespace

// Places beside the message are needed where odd pieces are missing, in whose place no symbol can
// be: of these at most all but one, since a block is decoded before it has as many symbols as
// pieces are missing.
std::size_t Partial::spare_places(const PieceLayout& layout) {
  const std::size_t odd = layout.odd();
  return layout.chunk <= code::kMostBytes && odd > 0 ? odd - 1 : 0;
}

std::size_t Partial::held_by(const wire::FragmentHeader& f) {
  const std::size_t beside =
      f.count() / kBitsPerByte + 1 + code::Blocks(f.count()).blocks() * sizeof(Block);
  return f.size + beside + spare_places({f.size, header_of(f), f.chunk}) * f.chunk;
}

void Partial::begin(const wire::FragmentHeader& f) {
  kind_ = f.kind;
  size_ = f.size;
  held_ = held_by(f);
  chunk_ = f.chunk;
  count_ = f.count();
  missing_ = count_;
  have_.assign(count_, false);
  state_.resize(blocks().blocks());
  for (std::size_t b = 0; b < state_.size(); ++b) {
    state_[b].missing = static_cast<std::uint8_t>(blocks().pieces(b));
    state_[b].symbols = 0;
  }
  taken_.reset();
  const std::size_t header = header_of(f);
  bytes_.header = {};
  for (std::size_t i = 0; i < header; ++i) bytes_.header.push_back(std::byte{0});
  bytes_.payload.reserve(f.size - header);
}

void Partial::end() {
  size_ = held_ = 0;
  // Not {}, which a vector takes for an empty list of values, and keeps its memory.
  bytes_ = wire::MessageBytes();
  spare_ = Bytes();
  if (count_ <= kMostKept) return;
  have_ = std::vector<bool>();
  state_ = std::vector<Block>();
}

bool Partial::has(std::uint16_t index) const {
  if (index < count_) return have_[index];
  const Block& block = state_[blocks().block_of(index)];
  const auto rows = std::span(block.rows).first(block.symbols);
  return block.missing == 0 || std::ranges::find(rows, blocks().row_of(index)) != rows.end();
}

void Partial::add(std::uint16_t index, ByteView bytes) {
  const std::size_t b = blocks().block_of(index);
  if (index < count_) return add_piece(b, index, bytes);
  const Loose symbol{static_cast<std::uint8_t>(blocks().row_of(index)), bytes};
  const Block& block = state_[b];
  if (block.symbols + 1 < block.missing) return keep(b, symbol);
  decode(b, symbol);
}

void Partial::add_piece(std::size_t b, std::size_t piece, ByteView bytes) {
  Block& block = state_[b];
  have_[piece] = true;
  --block.missing;
  --missing_;
  const auto places = std::span(block.places).first(block.symbols);
  const auto at = std::ranges::find(places, blocks().column_of(piece));
  std::optional<Loose> moved;
  std::array<std::byte, code::kMostBytes> copy;
  if (at != places.end()) moved = let_go(b, static_cast<std::size_t>(at - places.begin()), copy);
  store(piece, bytes);
  const std::size_t symbols = block.symbols + (moved ? 1U : 0U);
  if (block.missing > 0 && symbols == block.missing) return decode(b, moved);
  if (moved) keep(b, *moved);
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

// The first place in which a symbol of this block may wait.
std::size_t Partial::free_place(std::size_t b) const {
  const code::Blocks blocks = this->blocks();
  const Block& block = state_[b];
  std::bitset<code::kMostPieces> used;
  for (std::size_t i = 0; i < block.symbols; ++i) {
    if (block.places[i] < kFirstSpare) used.set(block.places[i]);
  }
  for (std::size_t c = 0; c < blocks.pieces(b); ++c) {
    const std::size_t piece = blocks.piece_at(b, c);
    if (!have_[piece] && !used[c] && layout().is_plain(piece)) return c;
  }
  std::size_t spare = 0;
  while (taken_[spare]) ++spare;
  assert(spare < spare_places(layout()));
  return kFirstSpare + spare;
}

std::byte* Partial::place(std::size_t b, std::size_t place) {
  if (place >= kFirstSpare) return spare_.data() + (place - kFirstSpare) * chunk_;
  return bytes_.payload.data() + layout().in_payload(blocks().piece_at(b, place));
}

void Partial::keep(std::size_t b, const Loose& symbol) {
  Block& block = state_[b];
  const std::size_t free = free_place(b);
  if (free >= kFirstSpare) {
    if (spare_.empty()) spare_.resize(spare_places(layout()) * chunk_);
    taken_.set(free - kFirstSpare);
  } else {
    const std::size_t end = layout().in_payload(blocks().piece_at(b, free)) + chunk_;
    if (bytes_.payload.size() < end) bytes_.payload.resize(end);
  }
  std::ranges::copy(symbol.bytes, place(b, free));
  block.rows[block.symbols] = symbol.row;
  block.places[block.symbols++] = static_cast<std::uint16_t>(free);
}

// Takes a symbol that waits out of its place, as a copy.
Partial::Loose Partial::let_go(std::size_t b, std::size_t i, std::span<std::byte> copy) {
  Block& block = state_[b];
  const Loose out{block.rows[i], copy.first(chunk_)};
  std::copy_n(place(b, block.places[i]), chunk_, copy.data());
  --block.symbols;
  block.rows[i] = block.rows[block.symbols];
  block.places[i] = block.places[block.symbols];
  return out;
}

// With the symbols that wait and `newest` there are as many as missing pieces.
void Partial::decode(std::size_t b, const std::optional<Loose>& newest) {
  const code::Blocks blocks = this->blocks();
  const PieceLayout layout = this->layout();
  Block& block = state_[b];
  const std::size_t columns = blocks.pieces(b);
  const std::size_t lost = block.missing;
  // All of the payload is there from now on, so that pieces are written where they belong.
  bytes_.payload.resize(size_ - bytes_.header.size());
  // Copies of the symbols, in whose places the pieces are written, and of odd pieces.
  Bytes copies((lost + std::min(columns, layout.odd())) * chunk_);
  std::byte* room = copies.data();
  std::array<code::Symbol, code::kMostRows> symbols;
  for (std::size_t i = 0; i < block.symbols; ++i, room += chunk_) {
    std::copy_n(place(b, block.places[i]), chunk_, room);
    symbols[i] = {block.rows[i], room};
    if (block.places[i] >= kFirstSpare) taken_.reset(block.places[i] - kFirstSpare);
  }
  if (newest) {
    std::ranges::copy(newest->bytes, room);
    symbols[block.symbols] = {newest->row, room};
    room += chunk_;
  }
  assert(block.symbols + (newest ? 1U : 0U) == lost);

  std::array<std::byte*, code::kMostPieces> pieces;
  std::array<std::uint8_t, code::kMostPieces> missing;
  std::size_t found = 0;
  for (std::size_t c = 0; c < columns; ++c) {
    const std::size_t piece = blocks.piece_at(b, c);
    if (!have_[piece]) missing[found++] = static_cast<std::uint8_t>(c);
    if (layout.is_plain(piece)) {
      pieces[c] = bytes_.payload.data() + layout.in_payload(piece);
      continue;
    }
    pieces[c] = room;
    room += chunk_;
    if (have_[piece]) layout.load(bytes_, piece, pieces[c]);
  }
  code::decode({pieces.data(), columns}, chunk_, {missing.data(), lost}, {symbols.data(), lost});
  for (std::size_t i = 0; i < lost; ++i) {
    const std::size_t piece = blocks.piece_at(b, missing[i]);
    have_[piece] = true;
    if (!layout.is_plain(piece)) store(piece, ByteView(pieces[missing[i]], layout.bytes_of(piece)));
  }
  missing_ -= lost;
  block.missing = block.symbols = 0;
}

}  // namespace interneuron::flow
