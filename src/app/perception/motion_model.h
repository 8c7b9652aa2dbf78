// What moves in front of one fixed camera: its background model, shared by all levels of a ladder.
// MotionStreams keeps one for each camera.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/video/background_segm.hpp>
#include <optional>
#include <vector>

#include "app/perception/codec.h"

namespace interneuron::perception {

// A connected area that moves, in pixels of the mask.
struct Blob {
  cv::Rect rect;
  // How many pixels of the rectangle move.
  int area = 0;
};

// One thread at a time.
class MotionModel {
 public:
  MotionModel();

  // The mask of what moves in the image, kSampledWidth x kSampledHeight, 255 or 0. Learns from the
  // image, but only once from a frame number, so that any number of levels may ask. Raw and sampled
  // images of a frame look the same to it. All 0 until a background is known.
  const cv::Mat& mask(const Image& image);
  void reset();

 private:
  cv::Ptr<cv::BackgroundSubtractorMOG2> subtractor_;
  cv::Mat mask_;
  // The number of the frame that mask_ is of.
  std::optional<std::uint32_t> frame_;
  // Frames learnt from since the last reset, at most as many as make a background.
  int learnt_ = 0;
};

// The connected areas of a mask after closing holes up to `close`, and growing by `grow` (both in
// pixels).
std::vector<Blob> blobs_of(const cv::Mat& mask, cv::Size close, cv::Size grow);

}  // namespace interneuron::perception
