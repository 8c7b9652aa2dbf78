// Where pictures come from: a video file, a folder of pictures (sorted by name), one picture, a
// camera or a stream.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "app/perception/input_error.h"

namespace interneuron::perception {

struct Frame {
  // 8 bits and 3 channels, not empty; the frame owns it.
  cv::Mat bgr{};
  // The position in the source, from 0; it begins again at 0 when a source loops.
  int index = 0;
};

struct FrameSourceOptions {
  // Whether a file or folder begins again at its end; a camera or stream has none.
  bool loop = false;
};

// Move-only; one thread at a time.
class FrameSource {
 public:
  // `spec`: "camera:0" or "/dev/video0"; a URL with "://"; else the path of a folder, a picture or
  // a video. Reads the first frame, so that a source which opens but holds no picture is found
  // here. Throws InputError when the source is missing, cannot be opened or is empty.
  explicit FrameSource(const std::string& spec, FrameSourceOptions options = {});
  ~FrameSource();
  FrameSource(FrameSource&&) noexcept;
  FrameSource& operator=(FrameSource&&) noexcept;

  // The next frame; nothing at the end of the source. A camera or stream blocks until a frame is
  // there. Throws InputError when a picture of a folder cannot be read.
  std::optional<Frame> next();

  // Whether frames come in their own time (camera, stream) and cannot be paced or looped by the
  // caller.
  bool live() const;

  // The implementation's door to one kind of source.
  class Reader;

 private:
  std::optional<cv::Mat> read_looping();

  std::unique_ptr<Reader> reader_;
  FrameSourceOptions options_;
  // The constructor reads the first frame, to fail early; next() hands it out.
  std::optional<cv::Mat> pending_;
  int next_index_ = 0;
};

}  // namespace interneuron::perception
