// Detectors that need no file: what moves in front of a fixed camera, and OpenCV's built-in Daimler
// people detector (HOG) on the moving regions, at the top on the whole frame too, which finds those
// who stand still.
//
// On the demo video (795 frames, raw), AP / AP50: motion .20 / .52; with HOG at 768 x 576 .28 /
// .81; at 960 x 720 .38 / .86; and on the whole frame .39 / .88. Where the camera moves, only the
// top level finds anyone.
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/objdetect.hpp>
#include <string>
#include <utility>

#include "perception/levels.h"
#include "perception/motion_model.h"

namespace interneuron::perception {
namespace {

// Sizes of persons are in pixels of a 768 x 576 view, which is what the demo video shows and where
// they were chosen.
constexpr float kViewWidth = 768;
constexpr float kViewHeight = 576;
constexpr float kMinHeight = 25;  // of a person; lower blobs are noise

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
  explicit MotionDetector(std::shared_ptr<MotionModel> model) : model_(std::move(model)) {}

  std::vector<Box> detect(const Image& image) override {
    const cv::Mat& mask = model_->mask(image);
    std::vector<Box> boxes;
    for (const Blob& blob : blobs_of(mask, kClose, kGrow)) split(blob, boxes);
    boxes = scaled(std::move(boxes), mask.size(), image.source);
    return suppress(std::move(boxes), 1.0F, 0.0F);
  }
  void reset() override { model_->reset(); }

 private:
  inline static const cv::Size kClose{3, 5};  // pixels of the mask; joins the parts of a person
  inline static const cv::Size kGrow{1, 1};   // not at all

  // Appends the persons of a blob, in pixels of the mask. The score tells how full the blob is and
  // how like a person.
  static void split(const Blob& blob, std::vector<Box>& boxes) {
    constexpr float kMinArea = 400;        // of a person
    constexpr float kPersonAspect = 2.3F;  // height / width
    constexpr float kWideAspect = 0.9F;    // width / height from which a blob is several persons
    constexpr float kColumnAspect = 0.5F;  // width / height of each of them
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

  std::shared_ptr<MotionModel> model_;
};

// HOG finds a person many times over, a little shifted. Their mean, weighted by score, lies better
// than the best of them: on the demo video AP .38 instead of .31, and OpenCV's own grouping, which
// also joins neighbours, gets .33.
std::vector<Box> fuse(std::vector<Box> boxes) {
  constexpr double kSameIou = 0.5;  // from which two boxes show the same person; best of .4, .5, .6
  constexpr float kWeightAtZero = 0.1F;  // chosen; the detector's margin starts at 0
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
  cv::Size view;      // pixels the image is scaled to
  double step;        // ratio of two neighbouring scales, > 1
  double whole_step;  // the same where the whole frame is searched; 0: it is not
};

class HogDetector : public Detector {
 public:
  HogDetector(std::shared_ptr<MotionModel> model, HogSettings settings)
      : model_(std::move(model)), settings_(settings), hog_(kWindow, {16, 16}, kStride, {8, 8}, 9) {
    hog_.setSVMDetector(cv::HOGDescriptor::getDaimlerPeopleDetector());
  }

  std::vector<Box> detect(const Image& image) override {
    const cv::Mat& mask = model_->mask(image);
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
    for (Box& box : found) box.score /= 1 + box.score;  // a margin >= 0, to 0 … 1
    return suppress(scaled(std::move(found), view.size(), image.source), kMaxIou, 0.0F);
  }
  void reset() override { model_->reset(); }

 private:
  inline static const cv::Size kWindow{48, 96};  // pixels; the Daimler detector's
  inline static const cv::Size kStride{8, 8};    // pixels; one cell
  inline static const cv::Size kClose{5, 7};     // pixels of the mask; joins the parts of a person
  inline static const cv::Size kGrow{5, 5};
  static constexpr float kMaxIou = 0.5F;  // of two persons' boxes
  static constexpr float kStillWeight =
      0.5F;  // of a find that does not move; .3 … .6 do equally well

  // Where to search, in pixels of the view: the blobs with a margin, at least a window. All
  // together at most half the view, the small ones first: when all moves, as for a moving camera,
  // the time stays bounded.
  std::vector<cv::Rect> moving_regions(const cv::Mat& mask) const {
    constexpr double kMargin = 14;  // pixels of the view, around the person
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
    // Parts of the window that a person does not fill; chosen on the demo video.
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

  std::shared_ptr<MotionModel> model_;
  HogSettings settings_;
  cv::HOGDescriptor hog_;
};

}  // namespace

std::vector<Level> motion_levels(std::size_t max_levels) {
  const auto model = std::make_shared<MotionModel>();
  const auto hog = [&](cv::Size view, double step, double whole_step) {
    return std::make_shared<HogDetector>(model, HogSettings{view, step, whole_step});
  };
  std::vector<Level> levels = {
      {.name = "motion", .detector = std::make_shared<MotionDetector>(model)},
      {.name = "motion+HOG 768x576", .detector = hog({768, 576}, 1.2, 0)},
      {.name = "motion+HOG 960x720", .detector = hog({960, 720}, 1.1, 0)},
      {.name = "motion+HOG 960x720 and the whole frame", .detector = hog({960, 720}, 1.1, 1.2)}};
  if (levels.size() > max_levels) levels.resize(max_levels);
  return levels;
}

}  // namespace interneuron::perception
