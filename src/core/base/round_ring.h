// What is remembered of the last rounds of one pipeline: a slot per round, found by the round's
// number modulo the number of slots. A round keeps its slot until one that is kSlots or more
// rounds younger takes it.
//
// Messages of old rounds arrive late, and a hostile peer may name any round. A straggler never
// pushes out a younger round: enter() answers nothing for it. Round numbers wrap, so "younger" is
// judged by their difference modulo 2^32.
//
// All slots lie inside the object: nothing is allocated by the ring itself. Pointers stay valid
// until the slot is taken by another round or the ring is cleared. Thread-compatible; pure. T is
// default-constructed for each round that enters.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "interneuron/units.h"

namespace interneuron {

// Enough for the rounds that are in flight at once and the 16 of which a header tells the outcome:
// 6.4 s at 10 rounds per second.
inline constexpr std::size_t kRoundSlots = 64;

// Whether round `a` began before round `b`.
constexpr bool is_older(RoundId a, RoundId b) {
  return static_cast<std::int32_t>(b.value - a.value) > 0;
}

template <class T, std::size_t kSlots = kRoundSlots>
class RoundRing {
  static_assert((kSlots & (kSlots - 1)) == 0, "the slots must follow each other when numbers wrap");

 public:
  // What is remembered of this round; nullptr when the ring does not hold it.
  T* find(RoundId round) {
    Slot& slot = slot_of(round);
    return slot.used && slot.round == round ? &slot.value : nullptr;
  }
  const T* find(RoundId round) const { return const_cast<RoundRing*>(this)->find(round); }

  // What is remembered of this round, a fresh T if it was not held; nullptr when a younger round
  // has its slot.
  T* enter(RoundId round) {
    Slot& slot = slot_of(round);
    if (slot.used && slot.round == round) return &slot.value;
    if (slot.used && is_older(round, slot.round)) return nullptr;
    slot = Slot{round, true, T{}};
    return &slot.value;
  }

  // Calls visit(RoundId, const T&) for every round held, in no particular order.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (const Slot& slot : slots_) {
      if (slot.used) visit(slot.round, slot.value);
    }
  }

  void clear() { slots_ = {}; }

 private:
  struct Slot {
    RoundId round{};
    bool used = false;
    T value{};
  };
  Slot& slot_of(RoundId round) { return slots_[round.value % kSlots]; }

  std::array<Slot, kSlots> slots_{};
};

}  // namespace interneuron
