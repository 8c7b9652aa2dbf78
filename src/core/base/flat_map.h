// A map of few keys, sorted in one block of memory: to look at all of them, as is done for the
// paths of a peer with each packet, follows no pointer from one to the next, unlike in a std::map.
//
// Adding and removing take linear time and move the values. References and iterators are valid
// until then. Thread-compatible; pure; nothing is allocated but by adding.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <utility>
#include <vector>

namespace interneuron {

template <class Key, class Value>
class FlatMap {
 public:
  using Entry = std::pair<Key, Value>;
  using iterator = typename std::vector<Entry>::iterator;
  using const_iterator = typename std::vector<Entry>::const_iterator;

  bool empty() const { return entries_.empty(); }
  std::size_t size() const { return entries_.size(); }
  iterator begin() { return entries_.begin(); }
  iterator end() { return entries_.end(); }
  const_iterator begin() const { return entries_.begin(); }
  const_iterator end() const { return entries_.end(); }

  iterator find(const Key& key) { return std::ranges::find(entries_, key, &Entry::first); }
  const_iterator find(const Key& key) const {
    return std::ranges::find(entries_, key, &Entry::first);
  }
  bool contains(const Key& key) const { return find(key) != end(); }
  // The key is there.
  Value& at(const Key& key) {
    const auto it = find(key);
    assert(it != end());
    return it->second;
  }
  const Value& at(const Key& key) const { return const_cast<FlatMap*>(this)->at(key); }

  // Adds a Value() unless the key is there; whether it was added.
  std::pair<iterator, bool> try_emplace(const Key& key) {
    const auto it = std::ranges::lower_bound(entries_, key, {}, &Entry::first);
    if (it != end() && it->first == key) return {it, false};
    return {entries_.emplace(it, key, Value()), true};
  }
  void erase(const_iterator it) { entries_.erase(it); }
  void clear() { entries_.clear(); }

 private:
  std::vector<Entry> entries_;
};

}  // namespace interneuron
