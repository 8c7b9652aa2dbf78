// Frames inside a link, in places of equal size that are reused: no allocation per packet once the
// link has been full. Thread-compatible. Memory: the most frames that were ever inside, rounded up
// to blocks.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace interneuron::netns {

class FrameStore {
 public:
  using Handle = std::uint64_t;

  static constexpr std::size_t kPlaceBytes = 2048;  // an Ethernet frame of 1500 bytes of IP

  // A copy of `frame` (at most kPlaceBytes); it stays until release().
  Handle add(std::span<const std::byte> frame) {
    assert(frame.size() <= kPlaceBytes);
    if (free_.empty()) add_block();
    const Handle handle = free_.back();
    free_.pop_back();
    Place& place = at(handle);
    std::copy(frame.begin(), frame.end(), place.bytes.begin());
    place.size = frame.size();
    return handle;
  }

  std::span<std::byte> operator[](Handle handle) {
    Place& place = at(handle);
    return {place.bytes.data(), place.size};
  }

  void release(Handle handle) { free_.push_back(handle); }

  std::size_t size() const { return blocks_.size() * kBlockPlaces - free_.size(); }

 private:
  struct Place {
    std::array<std::byte, kPlaceBytes> bytes;
    std::size_t size = 0;
  };
  static constexpr std::size_t kBlockPlaces = 128;

  Place& at(Handle handle) { return blocks_[handle / kBlockPlaces][handle % kBlockPlaces]; }

  void add_block() {
    const Handle first = blocks_.size() * kBlockPlaces;
    blocks_.push_back(std::make_unique<Place[]>(kBlockPlaces));
    for (std::size_t i = kBlockPlaces; i > 0; --i) free_.push_back(first + i - 1);
  }

  std::vector<std::unique_ptr<Place[]>> blocks_;
  std::vector<Handle> free_;  // the last one freed is used first: it is still in the cache
};

}  // namespace interneuron::netns
