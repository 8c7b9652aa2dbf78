// Keeps the bytes of frames that are inside an emulated link, in places of equal size that are
// reused: no allocation per frame once the most frames have been inside. Memory: 2 KiB for each
// frame of that peak, rounded up to blocks of 128, never given back. The queues, rates and delays
// of the links bound how many frames can be inside.
// Pure; thread-compatible. A handle is valid from add() to release(); using it otherwise is an
// error of the caller that is not detected.
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

  // More than an Ethernet frame with 1500 bytes of IP has.
  static constexpr std::size_t kPlaceBytes = 2048;

  // Keeps a copy of `frame` (at most kPlaceBytes) until release().
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

  // The number of frames kept.
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
  // Places that are free. The last one freed is used first, as its memory is still in the CPU
  // cache.
  std::vector<Handle> free_;
};

}  // namespace interneuron::netns
