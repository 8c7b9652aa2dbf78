// A message that is being put together from pieces and repair symbols.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "core/code/blocks.h"
#include "core/wire/message_bytes.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Memory for the pieces of one message, in the order in which they come.
//
// A message says how large it is with its first piece, and nobody knows whether the rest will ever
// come. So places for pieces are taken in runs that double: as many as have come already, and so
// never more than about twice what has arrived, by few calls of the heap however long the message
// is. A run never holds more places than the message has left. Partial owns one.
class Arena {
 public:
  // The first run; no measurement behind this value: a few packets.
  static constexpr std::size_t kFirstRun = 4;
  // A message has at most so many pieces.
  static constexpr std::size_t kMostPlaces = UINT16_MAX;

  // For `most` places of `bytes` bytes each, none of which is taken yet.
  void begin(std::size_t most, std::size_t bytes) {
    end();
    most_ = most;
    bytes_ = bytes;
  }
  // Frees all memory.
  void end() {
    for (auto& run : runs_) run.reset();
    taken_ = held_ = 0;
  }

  // Takes the next place; there must be one left.
  std::uint16_t take() {
    const std::size_t place = taken_++;
    const std::size_t run = run_of(place);
    if (!runs_[run]) {
      runs_[run] = std::make_unique_for_overwrite<std::byte[]>(run_bytes(place));
      held_ += run_bytes(place);
    }
    return static_cast<std::uint16_t>(place);
  }
  std::byte* at(std::uint16_t place) {
    return runs_[run_of(place)].get() + (place - first_of(place)) * bytes_;
  }
  const std::byte* at(std::uint16_t place) const { return const_cast<Arena*>(this)->at(place); }

  // Bytes that were taken from the heap, and those that the next take() will add.
  std::size_t held() const { return held_; }
  std::size_t next() const {
    return taken_ < most_ && !runs_[run_of(taken_)] ? run_bytes(taken_) : 0;
  }

 private:
  static std::size_t run_of(std::size_t place) {
    return place < kFirstRun ? 0 : static_cast<std::size_t>(std::bit_width(place / kFirstRun));
  }
  static std::size_t first_of(std::size_t place) {
    return place < kFirstRun ? 0 : std::bit_floor(place);
  }
  // The size of the run that this place lies in.
  std::size_t run_bytes(std::size_t place) const {
    const std::size_t first = first_of(place);
    return std::min(std::max(first, kFirstRun), most_ - first) * bytes_;
  }

  std::array<std::unique_ptr<std::byte[]>, std::bit_width(kMostPlaces / kFirstRun) + 1> runs_;
  std::size_t most_ = 0;
  std::size_t bytes_ = 0;
  std::size_t taken_ = 0;
  std::size_t held_ = 0;
};

// Takes the pieces and symbols of one message in any order and decodes a block as soon as it has as
// many symbols as pieces are missing. Reassembler owns a number of them, uses each for one message
// after the other, and checks before that what comes is valid and fits the message.
//
// Memory is taken for what has come (Arena), not for what the message says of its size: the first
// piece takes a few packets and some hundred bytes, 16 KB at most, however large the message claims
// to be. Pieces and symbols lie in the order of their arrival and are put in the message's order
// once, by take(). A block is decoded before it has more symbols than missing pieces, so that there
// are never more of both than the message has pieces. Decoding takes at most a millisecond a block
// and, while it lasts, a copy of the block's symbols; each block is decoded once, whatever a peer
// sends. Symbols that lie make a wrong message, as pieces do that lie. Pure; thread-compatible;
// never throws but std::bad_alloc.
class Partial {
 public:
  // A new message, of whose pieces this is one. Its chunk is at most code::kMostBytes.
  void begin(const wire::FragmentHeader& fragment);
  // Frees the message's memory but for some hundred bytes beside it, which the next one uses again.
  void end();

  bool is_open() const { return size_ > 0; }
  // Whether a fragment says of the message what the first one said.
  bool fits(const wire::FragmentHeader& fragment) const {
    return size_ == fragment.size && chunk_ == fragment.chunk && kind_ == fragment.kind;
  }
  // Whether nothing can be learnt from this piece or symbol.
  bool has(std::uint16_t index) const;
  // The most that begin() and add() of the first piece or symbol take, in bytes.
  static std::size_t first_growth(const wire::FragmentHeader& fragment);
  // What add() of this piece or symbol will take, in bytes.
  std::size_t growth(std::uint16_t index) const;
  // One that is not there yet.
  void add(std::uint16_t index, ByteView bytes);
  bool complete() const { return missing_ == 0; }
  std::size_t missing() const { return missing_; }
  // The whole message; ask once it is complete.
  wire::MessageBytes take() const;

  wire::MessageKind kind() const { return kind_; }
  std::size_t size() const { return size_; }
  // The bytes that are held; 0 where there is no message.
  std::size_t held() const { return is_open() ? beside_ + arena_.held() : 0; }

 private:
  // Where pieces lie, for so many pieces that follow each other: a place in arena_, or kNowhere.
  static constexpr std::size_t kPerPage = 256;
  static constexpr std::uint16_t kNowhere = UINT16_MAX;
  using Page = std::array<std::uint16_t, kPerPage>;
  static constexpr std::size_t pages_of(std::size_t pieces) {
    return (pieces + kPerPage - 1) / kPerPage;
  }
  // The symbols of a block that wait: their rows, and where they are.
  struct Waiting {
    std::array<std::uint8_t, code::kMostRows> rows;
    std::array<std::uint16_t, code::kMostRows> places;
  };
  struct Block {
    // Pieces that are not there, and symbols that wait; always fewer than these.
    std::uint8_t missing = 0;
    std::uint8_t symbols = 0;
    // Nothing before the first symbol.
    std::unique_ptr<Waiting> waiting;
  };
  code::Blocks blocks() const { return code::Blocks(count_); }
  std::uint16_t place_of(std::size_t piece) const {
    const auto& page = pages_[piece / kPerPage];
    return page ? (*page)[piece % kPerPage] : kNowhere;
  }
  // What is held beside pieces from the beginning.
  static std::size_t beside(const wire::FragmentHeader& fragment);
  void set_place(std::size_t piece, std::uint16_t place);
  void store(std::uint16_t place, ByteView bytes);
  void decode(std::size_t block);

  wire::MessageKind kind_{};
  // 0 while there is no message.
  std::size_t size_ = 0;
  std::uint16_t chunk_ = 1;
  std::uint16_t count_ = 0;
  std::size_t missing_ = 0;
  // What is held beside the arena.
  std::size_t beside_ = 0;
  std::vector<std::unique_ptr<Page>> pages_;
  std::vector<Block> state_;
  Arena arena_;
};

// A Reassembler's places move when it grows.
static_assert(std::is_nothrow_move_constructible_v<Partial>);

}  // namespace interneuron::flow
