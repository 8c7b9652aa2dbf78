// Tables of things that are named by numbers: IdMap finds the place of each of many, RecentSet
// tells whether one is among the newest of many.
//
// Both are open-addressed, because nodes of std::unordered_map and std::unordered_set are allocated
// one by one and take seven times the memory. A call takes constant time, but up to as many steps
// as there are identifiers where somebody chooses them so that they fall together: where peers
// choose them, the user bounds how many there are. Thread-compatible; pure.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace interneuron {

// Where the search for an identifier begins in a table of mask + 1 slots, a power of two. The
// factor is 2^32 divided by the golden ratio ("The Art of Computer Programming", Knuth, volume
// 3, 6.4).
template <class Number>
constexpr std::size_t home_of_id(Number id, std::size_t mask) {
  return (static_cast<std::uint32_t>(id) * 2654435769U >> 8U) & mask;
}

// An identifier -> a small number, such as an index into a vector. Memory doubles with the largest
// number of identifiers there have been at a time, to 16 bytes each, and is kept; nothing is
// allocated while there are no more identifiers than before.
template <class Id>
class IdMap {
 public:
  using Place = std::uint32_t;

  std::size_t size() const { return size_; }

  std::optional<Place> find(Id id) const {
    if (size_ == 0) return std::nullopt;
    const Slot& slot = slots_[slot_of(id)];
    return slot.place == kFree ? std::nullopt : std::optional(slot.place);
  }

  // Adds an identifier that is not there yet. Places are less than 2^32 - 1.
  void insert(Id id, Place place) {
    if (2 * (size_ + 1) > slots_.size()) grow();
    slots_[slot_of(id)] = {id, place};
    ++size_;
  }

  // Takes an identifier out if it is there, and moves up those behind it that would no longer be
  // found.
  void erase(Id id) {
    if (size_ == 0) return;
    std::size_t hole = slot_of(id);
    if (slots_[hole].place == kFree) return;
    --size_;
    for (std::size_t at = after(hole); slots_[at].place != kFree; at = after(at)) {
      const std::size_t from_home = (at - home(slots_[at].id)) & mask();
      if (from_home < ((at - hole) & mask())) continue;
      slots_[hole] = slots_[at];
      hole = at;
    }
    slots_[hole] = {};
  }

  void clear() {
    slots_.clear();
    size_ = 0;
  }

 private:
  static constexpr std::size_t kFirstSlots = 8;
  static constexpr Place kFree = UINT32_MAX;
  struct Slot {
    Id id{};
    Place place = kFree;
  };

  // A power of two, as every number of slots, so that the remainder is a mask. Half of the slots
  // are free.
  std::size_t mask() const { return slots_.size() - 1; }
  std::size_t home(Id id) const { return home_of_id(id.value, mask()); }
  std::size_t after(std::size_t slot) const { return (slot + 1) & mask(); }
  // Where the identifier is, or where it belongs.
  std::size_t slot_of(Id id) const {
    std::size_t slot = home(id);
    while (slots_[slot].place != kFree && slots_[slot].id != id) slot = after(slot);
    return slot;
  }

  void grow() {
    std::vector<Slot> old(slots_.empty() ? kFirstSlots : 2 * slots_.size());
    old.swap(slots_);
    for (const Slot& slot : old) {
      if (slot.place != kFree) slots_[slot_of(slot.id)] = slot;
    }
  }

  std::vector<Slot> slots_;
  std::size_t size_ = 0;
};

// The newest kSize identifiers. Memory doubles with the identifiers there have been, to 8 bytes
// each of kSize; nothing is allocated once kSize identifiers have come.
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

  std::size_t home(Id id) const { return home_of_id(id.value, table_.size() - 1); }
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
