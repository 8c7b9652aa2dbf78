// The place of each of many things that are named by numbers: an identifier -> a small number, such
// as an index into a vector. Open-addressed, because nodes of std::unordered_map are allocated one
// by one.
//
// Memory doubles with the largest number of identifiers there have been at a time, to 16 bytes
// each, and is kept. All calls take constant time, but up to size() steps where somebody chooses
// identifiers that fall together: the user bounds how many there are where peers choose.
// Thread-compatible; pure; nothing is allocated while there are no more identifiers than before.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace interneuron {

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
  // 2^32 divided by the golden ratio ("The Art of Computer Programming", Knuth, volume 3, 6.4).
  std::size_t home(Id id) const {
    return (static_cast<std::uint32_t>(id.value) * 2654435769U >> 8U) & mask();
  }
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

}  // namespace interneuron
