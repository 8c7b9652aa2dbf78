// Detectors that need no file: what moves in front of a fixed camera, and OpenCV's built-in Daimler
// people detector (HOG) on the moving regions, at the top on the whole frame too, which finds those
// who stand still.
//
// Where the camera moves, only the top level finds anyone.
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/objdetect.hpp>
#include <string>
#include <utility>

#include "app/perception/levels.h"
#include "app/perception/motion.h"

namespace interneuron::perception {
namespace {

// Sizes of persons are in pixels of a view of 768 x 576, the size of the demo video's frames.
constexpr float kViewWidth = 768;
constexpr float kViewHeight = 576;
// A blob that is lower than this is noise, not a person.
constexpr float kMinHeight = 25;

std::vector<Box> scaled(std::vector<Box> boxes, cv::Size from, cv::Size to) {
  const auto sx = static_cast<float>(to.width) / static_cast<float>(from.width);
  const auto sy = static_cast<float>(to.height) / static_cast<float>(from.height);
  for (Box& b : boxes) {
    b = {.x = b.x * sx, .y = b.y * sy, .w = b.w * sx, .h = b.h * sy, .score = b.score};
  }
  return boxes;
}

// Motion alone: each blob is a person, or several side by side.
class MotionDetector : public Detector {
 public:
  explicit MotionDetector(std::shared_ptr<MotionStreams> streams) : streams_(std::move(streams)) {}

  std::vector<Box> detect(const Image& image) override {
    const cv::Mat& mask = streams_->mask(image);
    std::vector<Box> boxes;
    for (const Blob& blob : blobs_of(mask, kClose, kGrow)) split(blob, boxes);
    boxes = scaled(std::move(boxes), mask.size(), image.source);
    return suppress(std::move(boxes), 1.0F, 0.0F);
  }
  void reset() override { streams_->reset(); }
  void forget(std::uint32_t sender) override { streams_->forget(sender); }

 private:
  // Gaps of this many pixels of the mask are closed, which joins the parts of a person.
  inline static const cv::Size kClose{3, 5};
  // A structuring element of one pixel leaves the blobs as large as they are.
  inline static const cv::Size kGrow{1, 1};

  // Appends the persons of a blob, in pixels of the mask. The score tells how full the blob is and
  // how like a person.
  static void split(const Blob& blob, std::vector<Box>& boxes) {
    // Pixels of the view that a person covers at least.
    constexpr float kMinArea = 400;
    // Height by width of a person.
    constexpr float kPersonAspect = 2.3F;
    // Width by height from which a blob is several persons side by side, and that of each of them.
    constexpr float kWideAspect = 0.9F;
    constexpr float kColumnAspect = 0.5F;
    const auto w = static_cast<float>(blob.rect.width);
    const auto h = static_cast<float>(blob.rect.height);
    const float view_w = w * kViewWidth / kSampledWidth;
    const float view_h = h * kViewHeight / kSampledHeight;
    if (view_w * view_h < kMinArea || view_h < kMinHeight) return;
    const float columns =
        view_w > kWideAspect * view_h ? std::round(view_w / (kColumnAspect * view_h)) : 1.0F;
    const float fill = static_cast<float>(blob.area) / (w * h);
    const float aspect = view_h * columns / view_w;
    const float likeness = std::exp(-std::abs(std::log(aspect / kPersonAspect)));
    for (float i = 0; i < columns; ++i) {
      boxes.push_back({.x = static_cast<float>(blob.rect.x) + i * w / columns,
                       .y = static_cast<float>(blob.rect.y),
                       .w = w / columns,
                       .h = h,
                       .score = fill * likeness});
    }
  }

  std::shared_ptr<MotionStreams> streams_;
};

// HOG finds a person many times over, a little shifted. Their mean, weighted by score, lies better
// than the best of them: on the demo video AP .38 instead of .31, and OpenCV's own grouping, which
// also joins neighbours, gets .33.
std::vector<Box> fuse(std::vector<Box> boxes) {
  // Boxes that overlap by this much show the same person; .4 and .6 give less AP.
  constexpr double kSameIou = 0.5;
  // Added to the margins, which start at 0, so that a box at the very margin has a weight too.
  constexpr float kWeightAtZero = 0.1F;
  std::stable_sort(boxes.begin(), boxes.end(),
                   [](const Box& a, const Box& b) { return a.score > b.score; });
  std::vector<Box> fused;
  while (!boxes.empty()) {
    const Box best = boxes.front();
    Box sum;
    float weights = 0;
    std::erase_if(boxes, [&](const Box& box) {
      if (box != best && iou(best, box) < kSameIou) return false;
      const float weight = box.score + kWeightAtZero;
      sum = {.x = sum.x + weight * box.x,
             .y = sum.y + weight * box.y,
             .w = sum.w + weight * box.w,
             .h = sum.h + weight * box.h};
      weights += weight;
      return true;
    });
    fused.push_back({.x = sum.x / weights,
                     .y = sum.y / weights,
                     .w = sum.w / weights,
                     .h = sum.h / weights,
                     .score = best.score});
  }
  return fused;
}

struct HogSettings {
  // The image is scaled to this size, in pixels, before it is searched.
  cv::Size view;
  // The ratio of two neighbouring scales, > 1, in the moving regions.
  double step;
  // The same for the search of the whole frame; 0 where only moving regions are searched.
  double whole_step;
};

class HogDetector : public Detector {
 public:
  HogDetector(std::shared_ptr<MotionStreams> streams, HogSettings settings)
      : streams_(std::move(streams)),
        settings_(settings),
        hog_(kWindow, {16, 16}, kStride, {8, 8}, 9) {
    hog_.setSVMDetector(cv::HOGDescriptor::getDaimlerPeopleDetector());
  }

  std::vector<Box> detect(const Image& image) override {
    const cv::Mat& mask = streams_->mask(image);
    cv::Mat view;
    cv::cvtColor(image.bgr, view, cv::COLOR_BGR2GRAY);
    cv::resize(view, view, settings_.view);
    std::vector<Box> found;
    for (const cv::Rect& region : moving_regions(mask)) {
      search(view, region, settings_.step, found);
    }
    found = fuse(std::move(found));
    if (settings_.whole_step > 0) {
      std::vector<Box> still;
      search(view, {{}, view.size()}, settings_.whole_step, still);
      for (Box box : fuse(std::move(still))) {
        box.score *= kStillWeight;
        found.push_back(box);
      }
    }
    found = drop_nested(std::move(found), kMaxShare);
    // A margin is 0 or more, a score 0 … 1.
    for (Box& box : found) box.score /= 1 + box.score;
    return suppress(scaled(std::move(found), view.size(), image.source), kMaxIou, 0.0F);
  }
  void reset() override { streams_->reset(); }
  void forget(std::uint32_t sender) override { streams_->forget(sender); }

 private:
  // The window of the Daimler detector, and by how much it moves: one cell. In pixels.
  inline static const cv::Size kWindow{48, 96};
  inline static const cv::Size kStride{8, 8};
  // Gaps that are closed, which joins the parts of a person, and by how much blobs then grow, in
  // pixels of the mask.
  inline static const cv::Size kClose{5, 7};
  inline static const cv::Size kGrow{5, 5};
  // Two persons' boxes overlap by at most this.
  static constexpr float kMaxIou = 0.5F;
  // Boxes that share more of the smaller one are one person: a window around two of them, or on
  // half of one. Lifts the precision at score .3 from .78 to .89, at the same AP.
  static constexpr double kMaxShare = 0.7;
  // What the margin of a find that does not move counts; .3 to .6 do equally well.
  static constexpr float kStillWeight = 0.5F;

  // Where to search, in pixels of the view: the blobs with a margin, at least a window. All
  // together at most half the view, the small ones first: when all moves, as for a moving camera,
  // the time stays bounded.
  std::vector<cv::Rect> moving_regions(const cv::Mat& mask) const {
    // Pixels of the view on each side of a blob; HOG wants to see the background of a person. With
    // 20 instead of 14 the AP falls by .016.
    constexpr double kMargin = 14;
    // The smallest region: a window and ten pixels around it.
    constexpr double kMinWidth = 64;
    constexpr double kMinRegionHeight = 116;
    const double sx = static_cast<double>(settings_.view.width) / mask.cols;
    const double sy = static_cast<double>(settings_.view.height) / mask.rows;
    std::vector<cv::Rect> regions;
    for (const Blob& blob : blobs_of(mask, kClose, kGrow)) {
      const cv::Rect2d at(blob.rect);
      if (at.height * kViewHeight / mask.rows < static_cast<double>(kMinHeight)) continue;
      const double w = std::max(at.width * sx + 2 * kMargin, kMinWidth);
      const double h = std::max(at.height * sy + 2 * kMargin, kMinRegionHeight);
      const cv::Rect2d region((at.x + at.width / 2) * sx - w / 2,
                              (at.y + at.height / 2) * sy - h / 2, w, h);
      const cv::Rect inside = cv::Rect(region) & cv::Rect({}, settings_.view);
      if (inside.width >= kWindow.width && inside.height >= kWindow.height)
        regions.push_back(inside);
    }
    std::sort(regions.begin(), regions.end(),
              [](const cv::Rect& a, const cv::Rect& b) { return a.area() < b.area(); });
    int left = settings_.view.area() / 2;
    std::erase_if(regions, [&](const cv::Rect& region) { return (left -= region.area()) < 0; });
    return regions;
  }

  // Appends what is found in a region, ungrouped, in pixels of the view; the score is the
  // detector's margin.
  void search(const cv::Mat& view, const cv::Rect& region, double step,
              std::vector<Box>& out) const {
    // Where a person stands in a window, as shares of its width and height. The values
    // were tried on the demo video: the boxes that they give have the accuracies of this file.
    constexpr float kLeft = 0.16F;
    constexpr float kTop = 0.07F;
    constexpr float kWide = 0.68F;
    constexpr float kHigh = 0.86F;
    constexpr double kNoGrouping = 0;
    std::vector<cv::Rect> windows;
    std::vector<double> margins;
    hog_.detectMultiScale(view(region), windows, margins, 0, kStride, {}, step, kNoGrouping);
    for (std::size_t i = 0; i < windows.size(); ++i) {
      const auto w = static_cast<float>(windows[i].width);
      const auto h = static_cast<float>(windows[i].height);
      out.push_back({.x = static_cast<float>(region.x + windows[i].x) + kLeft * w,
                     .y = static_cast<float>(region.y + windows[i].y) + kTop * h,
                     .w = kWide * w,
                     .h = kHigh * h,
                     .score = static_cast<float>(std::max(0.0, margins[i]))});
    }
  }

  std::shared_ptr<MotionStreams> streams_;
  HogSettings settings_;
  cv::HOGDescriptor hog_;
};

}  // namespace

std::vector<Level> motion_levels(std::size_t max_levels) {
  const auto streams = std::make_shared<MotionStreams>();
  const auto hog = [&](cv::Size view, double step, double whole_step) {
    return std::make_shared<HogDetector>(streams, HogSettings{view, step, whole_step});
  };
  // Quality, drawing threshold and run time: by motion_bench on the demo video, 795 frames.
  std::vector<Level> levels = {{.name = "motion",
                                .detector = std::make_shared<MotionDetector>(streams),
                                .quality = {0.199, 0.199},
                                .jpeg_quality = {0.205, 0.189, 0.090, 0.155},
                                .draw_score = 0.35F,
                                .recorded_median = from_ms(1.0)},
                               {.name = "motion+HOG 768x576",
                                .detector = hog({768, 576}, 1.2, 0),
                                .quality = {0.286, 0.275},
                                .jpeg_quality = {0.295, 0.290, 0.246, 0.275},
                                .draw_score = 0.35F,
                                .recorded_median = from_ms(2.6)},
                               {.name = "motion+HOG 960x720",
                                .detector = hog({960, 720}, 1.05, 0),
                                .quality = {0.384, 0.365},
                                .jpeg_quality = {0.393, 0.386, 0.361, 0.372},
                                .draw_score = 0.55F,
                                .recorded_median = from_ms(6.9)},
                               {.name = "motion+HOG 960x720 and the whole frame",
                                .detector = hog({960, 720}, 1.05, 1.2),
                                .quality = {0.397, 0.376},
                                .jpeg_quality = {0.403, 0.394, 0.381, 0.379},
                                .draw_score = 0.5F,
                                .recorded_median = from_ms(50.6)}};
  if (levels.size() > max_levels) levels.resize(max_levels);
  return levels;
}

}  // namespace interneuron::perception
