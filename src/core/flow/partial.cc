#include "core/flow/partial.h"

#include <cassert>
#include <cstring>

#include "core/code/erasure_code.h"

namespace interneuron::flow {
namespace {

// Places of pages and of blocks that are kept for the next message, beside the first page and the
// first block's symbols: those of messages of 1,600 pieces. No measurement behind this value: it
// only has to be more than common messages have, and little beside what a Reassembler keeps for
// each message at a time.
constexpr std::size_t kMostKept = 8;

}  // namespace

std::size_t Partial::beside(const wire::FragmentHeader& f) {
  return pages_of(f.count()) * sizeof(std::unique_ptr<Page>) +
         code::Blocks(f.count()).blocks() * sizeof(Block);
}

void Partial::begin(const wire::FragmentHeader& f) {
  assert(f.chunk <= code::kMostBytes);
  kind_ = f.kind;
  size_ = f.size;
  chunk_ = f.chunk;
  count_ = f.count();
  missing_ = count_;
  pages_.resize(pages_of(count_));
  state_.resize(blocks().blocks());
  beside_ = beside(f);
  // What is kept of the message before.
  if (pages_.front()) {
    pages_.front()->fill(kNowhere);
    beside_ += sizeof(Page);
  }
  beside_ += state_.front().waiting ? sizeof(Waiting) : 0;
  for (std::size_t b = 0; b < state_.size(); ++b) {
    state_[b].missing = static_cast<std::uint8_t>(blocks().pieces(b));
    state_[b].symbols = 0;
  }
  arena_.begin(count_, chunk_);
}

void Partial::end() {
  size_ = beside_ = 0;
  arena_.end();
  if (pages_.capacity() <= kMostKept && state_.capacity() <= kMostKept) {
    pages_.resize(std::min<std::size_t>(pages_.size(), 1));
    state_.resize(std::min<std::size_t>(state_.size(), 1));
    return;
  }
  pages_ = std::vector<std::unique_ptr<Page>>();
  state_ = std::vector<Block>();
}

bool Partial::has(std::uint16_t index) const {
  if (index < count_) return place_of(index) != kNowhere;
  const Block& block = state_[blocks().block_of(index)];
  if (block.missing == 0) return true;
  if (block.symbols == 0) return false;
  const auto rows = std::span(block.waiting->rows).first(block.symbols);
  return std::ranges::find(rows, blocks().row_of(index)) != rows.end();
}

std::size_t Partial::first_growth(const wire::FragmentHeader& f) {
  const std::size_t first_run = std::min<std::size_t>(f.count(), Arena::kFirstRun) * f.chunk;
  return beside(f) + first_run + sizeof(Page) + sizeof(Waiting);
}

std::size_t Partial::growth(std::uint16_t index) const {
  const Block& block = state_[blocks().block_of(index)];
  const bool is_symbol = index >= count_;
  std::size_t out = arena_.next();
  if (is_symbol && !block.waiting) out += sizeof(Waiting);
  const std::size_t missing = block.missing - (is_symbol ? 0U : 1U);
  if (missing > 0 && block.symbols + (is_symbol ? 1U : 0U) == missing) {
    // The block is decoded, and pieces of it may lie anywhere.
    out += static_cast<std::size_t>(
               std::ranges::count_if(pages_, [](const auto& page) { return !page; })) *
           sizeof(Page);
  } else if (!is_symbol && !pages_[index / kPerPage]) {
    out += sizeof(Page);
  }
  return out;
}

void Partial::set_place(std::size_t piece, std::uint16_t place) {
  auto& page = pages_[piece / kPerPage];
  if (!page) {
    page = std::make_unique<Page>();
    page->fill(kNowhere);
    beside_ += sizeof(Page);
  }
  (*page)[piece % kPerPage] = place;
}

// The last piece may be shorter than the others; for a code, zeros follow it.
void Partial::store(std::uint16_t place, ByteView bytes) {
  std::byte* const to = arena_.at(place);
  std::memcpy(to, bytes.data(), bytes.size());
  std::memset(to + bytes.size(), 0, chunk_ - bytes.size());
}

void Partial::add(std::uint16_t index, ByteView bytes) {
  const std::size_t b = blocks().block_of(index);
  Block& block = state_[b];
  const std::uint16_t place = arena_.take();
  store(place, bytes);
  if (index < count_) {
    set_place(index, place);
    --block.missing;
    --missing_;
  } else {
    if (!block.waiting) {
      block.waiting = std::make_unique<Waiting>();
      beside_ += sizeof(Waiting);
    }
    block.waiting->rows[block.symbols] = static_cast<std::uint8_t>(blocks().row_of(index));
    block.waiting->places[block.symbols++] = place;
  }
  if (block.missing > 0 && block.symbols == block.missing) decode(b);
}

// There are as many symbols as missing pieces, which take their places.
void Partial::decode(std::size_t b) {
  const code::Blocks blocks = this->blocks();
  Block& block = state_[b];
  const std::size_t columns = blocks.pieces(b);
  const std::size_t lost = block.missing;
  Bytes copies(lost * chunk_);
  std::array<code::Symbol, code::kMostRows> symbols;
  for (std::size_t i = 0; i < lost; ++i) {
    std::byte* const copy = copies.data() + i * chunk_;
    std::memcpy(copy, arena_.at(block.waiting->places[i]), chunk_);
    symbols[i] = {block.waiting->rows[i], copy};
  }
  std::array<std::byte*, code::kMostPieces> pieces;
  std::array<std::uint8_t, code::kMostPieces> missing;
  std::size_t found = 0;
  for (std::size_t c = 0; c < columns; ++c) {
    const std::size_t piece = blocks.piece_at(b, c);
    if (place_of(piece) == kNowhere) {
      set_place(piece, block.waiting->places[found]);
      missing[found++] = static_cast<std::uint8_t>(c);
    }
    pieces[c] = arena_.at(place_of(piece));
  }
  assert(found == lost);
  code::decode({pieces.data(), columns}, chunk_, {missing.data(), lost}, {symbols.data(), lost});
  missing_ -= lost;
  block.missing = block.symbols = 0;
}

wire::MessageBytes Partial::take() const {
  wire::MessageBytes out;
  std::size_t header = std::min<std::size_t>(size_, wire::header_bytes(kind_));
  out.payload.reserve(size_ - header);
  bool is_known = false;
  for (std::size_t piece = 0; piece < count_; ++piece) {
    const std::byte* at = arena_.at(place_of(piece));
    const std::byte* const end = at + std::min<std::size_t>(chunk_, size_ - piece * chunk_);
    while (at != end && out.header.size() < header) {
      out.header.push_back(*at++);
      if (is_known || out.header.size() < header) continue;
      // Pieces may be shorter than what says how long the header is.
      is_known = true;
      header = std::min<std::size_t>(size_, wire::header_bytes(kind_, out.header_view()));
    }
    out.payload.insert(out.payload.end(), at, end);
  }
  return out;
}

}  // namespace interneuron::flow
