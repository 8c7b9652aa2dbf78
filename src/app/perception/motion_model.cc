#include "app/perception/motion_model.h"

#include <opencv2/imgproc.hpp>

namespace interneuron::perception {
namespace {

// MOG2's own defaults (OpenCV 4.6), written out because the accuracies in motion_levels.cc were
// measured with them.
// The background is what the last so many frames show; 2,000 gain .004 AP and take four times as
// long to forget what moved away.
constexpr int kHistory = 500;
// A squared Mahalanobis distance: a pixel further from all its known colours moves.
constexpr double kVarThreshold = 16;
// Mask values above this move; the model marks shadows with 127.
constexpr int kForeground = 200;
// Side in pixels of the median filter that removes single noisy pixels.
constexpr int kSpeckle = 3;
// Frames until a background is known: the first is all foreground, the second shows each mover
// twice.
constexpr int kFramesToKnow = 2;

// The image as the sampled variant shows it, so that both variants feed one model.
cv::Mat sampled(const cv::Mat& bgr) {
  if (bgr.size() == cv::Size(kSampledWidth, kSampledHeight)) return bgr;
  if (bgr.size() == cv::Size(kRawWidth, kRawHeight)) return every_second_pixel(bgr);
  cv::Mat out;
  cv::resize(bgr, out, {kSampledWidth, kSampledHeight}, 0, 0, cv::INTER_AREA);
  return out;
}

}  // namespace

MotionModel::MotionModel() { reset(); }

void MotionModel::reset() {
  subtractor_ = cv::createBackgroundSubtractorMOG2(kHistory, kVarThreshold, true);
  mask_ = cv::Mat::zeros(kSampledHeight, kSampledWidth, CV_8U);
  frame_.reset();
  learnt_ = 0;
}

const cv::Mat& MotionModel::mask(const Image& image) {
  if (frame_ == image.frame) return mask_;
  frame_ = image.frame;
  cv::Mat classes;
  subtractor_->apply(sampled(image.bgr), classes);
  if (learnt_ < kFramesToKnow) {
    ++learnt_;
    return mask_;
  }
  cv::threshold(classes, mask_, kForeground, 255, cv::THRESH_BINARY);
  cv::medianBlur(mask_, mask_, kSpeckle);
  return mask_;
}

std::vector<Blob> blobs_of(const cv::Mat& mask, cv::Size close, cv::Size grow) {
  cv::Mat work;
  cv::morphologyEx(mask, work, cv::MORPH_CLOSE, cv::getStructuringElement(cv::MORPH_RECT, close));
  if (grow.area() > 1) {
    cv::dilate(work, work, cv::getStructuringElement(cv::MORPH_RECT, grow));
  }
  cv::Mat labels;
  cv::Mat stats;
  cv::Mat centres;
  const int count = cv::connectedComponentsWithStats(work, labels, stats, centres);
  std::vector<Blob> blobs;
  for (int i = 1; i < count; ++i) {  // 0 is the background
    const auto* s = stats.ptr<int>(i);
    blobs.push_back(
        {{s[cv::CC_STAT_LEFT], s[cv::CC_STAT_TOP], s[cv::CC_STAT_WIDTH], s[cv::CC_STAT_HEIGHT]},
         s[cv::CC_STAT_AREA]});
  }
  return blobs;
}

}  // namespace interneuron::perception
