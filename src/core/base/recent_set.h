// The newest kSize of many identifiers: whether one is among them. An open-addressed table beside a
// ring, because nodes of std::unordered_set take seven times the memory.
//
// Memory doubles with the identifiers there have been, to 8 bytes each of kSize. A lookup takes
// constant time, but up to kSize steps where somebody chooses identifiers that fall together: the
// user keeps kSize small where peers choose. Thread-compatible; pure; nothing is allocated once
// kSize identifiers have come.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace interneuron {

template <class Id, std::size_t kSize>
class RecentSet {
  static_assert(std::has_single_bit(kSize) && kSize < UINT16_MAX);

 public:
  bool contains(Id id) const { return !order_.empty() && table_[place_of(id)] != kFree; }

  // Adds an identifier that is not there yet. The oldest one makes room.
  void insert(Id id) {
    if (size_ == order_.size() && size_ < kSize) grow();
    if (size_ == kSize) {
      erase(order_[head_]);
      head_ = (head_ + 1) % kSize;
      --size_;
    }
    put(id);
  }

  void clear() {
    order_.clear();
    table_.clear();
    head_ = size_ = 0;
  }

 private:
  static constexpr std::size_t kFirstSize = 16;
  static constexpr std::uint16_t kFree = UINT16_MAX;

  // 2^32 divided by the golden ratio ("The Art of Computer Programming", Knuth, volume 3, 6.4).
  std::size_t home(Id id) const {
    return (static_cast<std::uint32_t>(id.value) * 2654435769U >> 8U) & (table_.size() - 1);
  }
  std::size_t after(std::size_t place) const { return (place + 1) & (table_.size() - 1); }

  // Where the identifier is in the table, or where it belongs. Half of the table is free.
  std::size_t place_of(Id id) const {
    std::size_t place = home(id);
    while (table_[place] != kFree && order_[table_[place]] != id) place = after(place);
    return place;
  }

  void put(Id id) {
    const std::size_t at = (head_ + size_) & (order_.size() - 1);
    order_[at] = id;
    table_[place_of(id)] = static_cast<std::uint16_t>(at);
    ++size_;
  }

  // Takes it out of the table, and moves up those behind it that would no longer be found.
  void erase(Id id) {
    std::size_t hole = place_of(id);
    for (std::size_t place = after(hole); table_[place] != kFree; place = after(place)) {
      const std::size_t mask = table_.size() - 1;
      const std::size_t from_home = (place - home(order_[table_[place]])) & mask;
      if (from_home < ((place - hole) & mask)) continue;
      table_[hole] = table_[place];
      hole = place;
    }
    table_[hole] = kFree;
  }

  void grow() {
    std::vector<Id> old(order_.empty() ? kFirstSize : 2 * order_.size());
    old.swap(order_);
    table_.assign(2 * order_.size(), kFree);
    const std::size_t count = size_;
    const std::size_t first = head_;
    head_ = size_ = 0;
    for (std::size_t i = 0; i < count; ++i) put(old[(first + i) % old.size()]);
  }

  // The identifiers, the oldest at head_; and for each its place there, by its hash.
  std::vector<Id> order_;
  std::vector<std::uint16_t> table_;
  std::size_t head_ = 0;
  std::size_t size_ = 0;
};

}  // namespace interneuron
