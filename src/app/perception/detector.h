// Detectors, and the ladder of them that a road side climbs up and down as its time budget allows.
//
// Levels are ordered by quality, the lowest first. How long each takes is measured at start-up
// (calibrate()), never assumed: the same machine drifts by 10-15 %. All detectors compute on one
// thread, the caller's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/perception/codec.h"
#include "app/perception/detection.h"
#include "app/perception/input_error.h"
#include "interneuron/time.h"

namespace interneuron::perception {

// What a detector finds for one sender depends on that sender's images alone, whatever it learns
// from images. One thread at a time.
class Detector {
 public:
  virtual ~Detector() = default;
  // The persons in the image, best score first, at most kMaxBoxes, in pixels of the image's source.
  virtual std::vector<Box> detect(const Image& image) = 0;
  // Forgets what was learnt from earlier images (a background); most detectors learn nothing.
  virtual void reset() {}
  // Forgets what was learnt from the images of this sender (Image::sender), who is gone.
  virtual void forget(std::uint32_t /*sender*/) {}
};

// One way to find persons in an image: more quality takes more time.
struct Level {
  // What people read, for example "yolox-nano 256x192".
  std::string name{};
  std::shared_ptr<Detector> detector{};
  // R[l], the median and the 95th percentile of how long one image takes on this machine: set by
  // Ladder::calibrate(), or known from the start. 0: unknown.
  Duration r_median{};
  Duration r_p95{};
  // AP (COCO's, 0 … 1) on raw and on sampled images, measured on the demo video's 795 frames; the
  // data folder's profile.csv comes first where it knows the level. Empty: unknown.
  std::vector<double> quality{};
  // The same on the JPEGs of variants_of(Images::kJpeg).
  std::vector<double> jpeg_quality{};
  // Boxes scored below this are not worth drawing: the score that gave the highest F1 (harmonic
  // mean of precision and recall at IoU .50) on the same frames.
  float draw_score = 0.3F;
  // How long one image took where the quality was measured, on one core; kAuto goes by it, before
  // anything is calibrated. 0: unknown.
  Duration recorded_median{};

  // By variant of such images, the best first.
  const std::vector<double>& quality_on(Images images) const {
    return images == Images::kPaper ? quality : jpeg_quality;
  }
};

// The most quality on raw images that the levels give within `budget`, by their recorded medians; a
// budget of 0 bounds nothing. The lowest level runs even where it does not fit, for nothing.
double expected_quality(std::span<const Level> levels, Duration budget);

// A copy shares the detectors, and the levels may share a background model: use one thread at a
// time, and make_ladder() again for a second user.
class Ladder {
 public:
  // Called after each level: its name and times are there; `done` of `total` levels are.
  using Progress = std::function<void(const Level& level, std::size_t done, std::size_t total)>;

  // Requires: at least one level, at most 256. `title`: what runs, and why, one line without the
  // times. `times_known`: the levels come with their times, calibrate() leaves them alone.
  Ladder(std::string title, std::vector<Level> levels, bool times_known = false);

  std::size_t size() const { return levels_.size(); }
  // Requires: index < size().
  const Level& level(std::size_t index) const { return levels_[index]; }
  std::vector<Box> detect(std::size_t index, const Image& image) {
    return levels_[index].detector->detect(image);
  }
  void forget(std::uint32_t sender) {
    for (const Level& level : levels_) level.detector->forget(sender);
  }

  // Measures median and 95th percentile of every level over `runs` images, taken in turn from
  // `images`, after a warm-up. Forgets all learnt backgrounds. Throws InputError when `images` is
  // empty or runs < 1.
  // `pause` before each run: between the images of a camera the processor idles and its caches
  // cool, and back-to-back runs would measure times that no image in operation sees.
  void calibrate(std::span<const Image> images, int runs, const Progress& progress = {},
                 Duration pause = {});

  // The best level whose 95th percentile fits into the budget, else 0; 0 too while the times are
  // unknown.
  std::size_t top_level(Duration budget) const;

  // One line that says which ladder runs, its levels, and their times once known.
  std::string description() const;
  const std::string& title() const { return title_; }

 private:
  std::string title_;
  std::vector<Level> levels_;
  bool times_known_;
};

enum class LadderKind {
  // The one of kDnn and kMotion with the higher expected_quality() in LadderOptions::budget, kDnn
  // where they differ by less than .01 or no budget is given; kMotion where models are missing. The
  // description says why.
  kAuto,
  // yolo-fastest and yolox-nano on OpenCV's dnn; needs <data>/models.
  kDnn,
  // Motion and HOG, for fixed cameras; needs no file. Its top level searches the whole frame.
  kMotion,
  // Recorded boxes of the demo video; needs <data>/detections and <data>/profile.csv.
  kReplay,
};

// "auto", "dnn", "motion" or "replay".
std::optional<LadderKind> parse_ladder_kind(std::string_view text);

struct LadderOptions {
  LadderKind kind = LadderKind::kAuto;
  // Where models and recordings are; kMotion needs none.
  std::filesystem::path data_dir{};
  // The time that a round leaves for one image; kAuto chooses by it. 0: no bound.
  Duration budget{};
  // Only so many levels, from the lowest; 1 makes a vehicle's local backup. 0: all.
  std::size_t max_levels = 0;
  // kReplay: lets a level's time R[l] pass; default: sleeps. A simulator advances its virtual time
  // instead.
  std::function<void(Duration)> spend{};
};

// Each call makes its own detectors. Throws InputError naming a missing or bad file and the remedy;
// kAuto never does for a missing one. Limits OpenCV to one thread for the whole process.
Ladder make_ladder(const LadderOptions& options);

}  // namespace interneuron::perception
