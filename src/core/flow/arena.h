// Memory for the pieces of one message, in the order in which they come.
//
// A message says how large it is with its first piece, and nobody knows whether the rest will ever
// come. So places for pieces are taken in runs that double: as many as have come already, and so
// never more than about twice what has arrived, by few calls of the heap however long the message
// is. A run never holds more places than the message has left. Partial owns one. Pure;
// thread-compatible; never throws but std::bad_alloc.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace interneuron::flow {

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

}  // namespace interneuron::flow
