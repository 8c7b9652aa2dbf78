// The frames of a source, decoded one ahead of the rounds, and made as small as the paper's raw
// image. Both take milliseconds, and more the larger the frames are, so they are done on a worker
// of the node, behind the local backup of the round before. A camera of a vehicle would hand over
// such a frame at the instant of the round; JPEGs are made of it after that instant.
//
// Holds at most one decoded frame. Used on the node's thread; it must outlive the node, whose
// worker may be decoding.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "app/perception/codec.h"
#include "app/perception/frame_source.h"
#include "interneuron/node.h"

namespace interneuron::offload {

class Camera {
 public:
  struct Shot {
    perception::Frame frame;
    // The frame's raw variant, which the local backup sees.
    perception::Image raw;
  };

  // `source` as FrameSource takes it; with `loop`, a file begins again at its end. Throws
  // InputError.
  Camera(const std::string& source, bool loop) : source_(source, {.loop = loop}) {}

  // Begins to decode the next frame. Not while one is being decoded.
  void fetch(Node& node);
  bool fetching() const { return fetching_; }
  // Calls `then` once, as soon as the frame that is being decoded is there.
  void when_fetched(std::function<void()> then) { then_ = std::move(then); }
  // The frame that was fetched last; nothing after the end of the source.
  std::optional<Shot> take() { return std::exchange(next_, std::nullopt); }

 private:
  perception::FrameSource source_;
  std::optional<Shot> next_;
  bool fetching_ = false;
  std::function<void()> then_;
};

}  // namespace interneuron::offload
