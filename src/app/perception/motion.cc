#include "app/perception/motion.h"

#include <algorithm>
#include <chrono>
#include <opencv2/imgproc.hpp>
#include <utility>

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

MotionStreams::Key MotionStreams::key_of(const Image& image) {
  // Raw and sampled show the same, and so do the JPEGs.
  Variant form = image.variant;
  if (form == Variant::kSampled) form = Variant::kRaw;
  if (is_jpeg(form)) form = Variant::kJpeg;
  return {image.sender, image.source.width, image.source.height, static_cast<int>(form)};
}

const cv::Mat& MotionStreams::mask(const Image& image, TimePoint now) {
  return stream(key_of(image), now).model->mask(image);
}

const cv::Mat& MotionStreams::mask(const Image& image) {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return mask(image, TimePoint{std::chrono::duration_cast<Duration>(now)});
}

void MotionStreams::forget(std::uint32_t sender) {
  std::erase_if(streams_, [sender](const auto& entry) { return entry.first.sender == sender; });
}

MotionStreams::Stream& MotionStreams::stream(const Key& key, TimePoint now) {
  std::erase_if(streams_, [now](const auto& entry) { return now - entry.second.used > kLifetime; });
  auto found = streams_.find(key);
  if (found == streams_.end()) {
    make_room(key.sender);
    found = streams_.emplace(key, Stream{std::make_unique<MotionModel>(), now}).first;
  }
  found->second.used = now;
  return found->second;
}

std::size_t MotionStreams::of_sender(std::uint32_t sender) const {
  return static_cast<std::size_t>(std::ranges::count_if(
      streams_, [sender](const auto& entry) { return entry.first.sender == sender; }));
}

// A sender that has all that it may have gives up a stream of its own, else whoever has most.
void MotionStreams::make_room(std::uint32_t sender) {
  const bool full = streams_.size() >= kMaxStreams;
  const bool own = of_sender(sender) >= kMaxPerSender;
  if (!full && !own) return;
  // How much there is to be said for keeping it: the fewer streams its sender has and the later it
  // was used, the more.
  const auto worth = [&](const auto& entry) {
    const auto count = static_cast<std::int64_t>(of_sender(entry.first.sender));
    const bool candidate = !own || entry.first.sender == sender;
    return std::pair{candidate ? -count : 1, entry.second.used};
  };
  streams_.erase(std::ranges::min_element(streams_, {}, worth));
}

}  // namespace interneuron::perception
