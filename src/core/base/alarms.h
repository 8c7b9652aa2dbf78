// One deadline for each of many: which is the earliest, and which are due. An indexed binary heap,
// so that a deadline is set, moved or removed in O(log n) and the earliest is read in O(1), however
// many there are.
//
// Keys are small numbers that the user gives out densely and uses again, such as places in a
// vector: memory is proportional to the largest key, and nothing is allocated for a key that was
// used before. Of equal deadlines the one of the smaller key is due first, so that runs repeat.
// Thread-compatible; pure; never throws but std::bad_alloc.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "interneuron/time.h"

namespace interneuron {

class Alarms {
 public:
  using Key = std::uint32_t;

  // The deadline of `key` is `at` from now on, whatever it was before.
  void set(Key key, TimePoint at) {
    if (key >= places_.size()) places_.resize(std::size_t{key} + 1, kNowhere);
    const Alarm alarm{at, key};
    if (places_[key] == kNowhere) {
      heap_.push_back(alarm);
      rise(heap_.size() - 1, alarm);
    } else {
      replace(places_[key], alarm);
    }
  }

  // `key` has no deadline any more.
  void remove(Key key) {
    if (key >= places_.size() || places_[key] == kNowhere) return;
    const std::size_t place = places_[key];
    places_[key] = kNowhere;
    const Alarm last = heap_.back();
    heap_.pop_back();
    if (place < heap_.size()) replace(place, last);
  }

  std::optional<TimePoint> earliest() const {
    return heap_.empty() ? std::nullopt : std::optional(heap_.front().at);
  }

  // The key of the earliest deadline if that is at or before `now`; nothing when none is.
  std::optional<Key> due(TimePoint now) const {
    if (heap_.empty() || heap_.front().at > now) return std::nullopt;
    return heap_.front().key;
  }
  // The same, and takes that deadline.
  std::optional<Key> pop_due(TimePoint now) {
    const std::optional<Key> key = due(now);
    if (key) remove(*key);
    return key;
  }

  std::size_t size() const { return heap_.size(); }

 private:
  struct Alarm {
    TimePoint at{};
    Key key = 0;
    friend auto operator<=>(const Alarm&, const Alarm&) = default;
  };
  static constexpr std::size_t kNowhere = SIZE_MAX;

  void put(std::size_t place, const Alarm& alarm) {
    heap_[place] = alarm;
    places_[alarm.key] = place;
  }

  // Puts `alarm` at `place`, which is free, or as far towards the root as it belongs.
  void rise(std::size_t place, const Alarm& alarm) {
    while (place > 0 && alarm < heap_[(place - 1) / 2]) {
      put(place, heap_[(place - 1) / 2]);
      place = (place - 1) / 2;
    }
    put(place, alarm);
  }

  // The same in either direction.
  void replace(std::size_t place, const Alarm& alarm) {
    if (place > 0 && alarm < heap_[(place - 1) / 2]) {
      rise(place, alarm);
      return;
    }
    for (std::size_t child = 2 * place + 1; child < heap_.size(); child = 2 * place + 1) {
      if (child + 1 < heap_.size() && heap_[child + 1] < heap_[child]) ++child;
      if (!(heap_[child] < alarm)) break;
      put(place, heap_[child]);
      place = child;
    }
    put(place, alarm);
  }

  std::vector<Alarm> heap_;
  // Where in the heap each key is.
  std::vector<std::size_t> places_;
};

}  // namespace interneuron
