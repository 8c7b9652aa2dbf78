// Frames inside one direction of a link, first in, first out, in large blocks that are reused: no
// allocation per packet once the link has been full. Thread-compatible. Memory: the most bytes that
// were ever inside, rounded up to blocks.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <vector>

namespace interneuron::netns {

class FrameStore {
 public:
  FrameStore() = default;
  FrameStore(FrameStore&&) = default;  // frames stay where they are
  FrameStore& operator=(FrameStore&&) = default;

  static constexpr std::size_t kBlockBytes = std::size_t{256} * 1024;

  // A copy of `frame` (at most kBlockBytes), the newest; the result is valid until it is popped.
  std::span<std::byte> push(std::span<const std::byte> frame) {
    assert(frame.size() <= kBlockBytes);
    if (blocks_.empty() || blocks_.back()->used + frame.size() > kBlockBytes) add_block();
    Block& block = *blocks_.back();
    std::byte* const start = block.bytes.data() + block.used;
    std::copy(frame.begin(), frame.end(), start);
    block.used += frame.size();
    ++block.frames;
    frames_.push_back({start, frame.size()});
    return frames_.back();
  }

  std::size_t size() const { return frames_.size(); }

  // The i-th oldest.
  std::span<std::byte> at(std::size_t i) const { return frames_[i]; }

  void pop_oldest() {
    frames_.pop_front();
    Block& oldest = *blocks_.front();
    if (--oldest.frames > 0) return;
    oldest.used = 0;
    if (blocks_.size() == 1) return;
    spare_.push_back(std::move(blocks_.front()));
    blocks_.pop_front();
  }

 private:
  struct Block {
    std::array<std::byte, kBlockBytes> bytes;
    std::size_t used = 0;
    std::size_t frames = 0;
  };

  void add_block() {
    if (spare_.empty()) {
      blocks_.push_back(std::make_unique<Block>());
    } else {
      blocks_.push_back(std::move(spare_.back()));
      spare_.pop_back();
    }
  }

  std::deque<std::span<std::byte>> frames_;
  std::deque<std::unique_ptr<Block>> blocks_;  // oldest first; each but the newest holds a frame
  std::vector<std::unique_ptr<Block>> spare_;
};

}  // namespace interneuron::netns
