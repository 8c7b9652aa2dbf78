#include <algorithm>
#include <cassert>
#include <chrono>
#include <cstdio>
#include <opencv2/core.hpp>
#include <thread>
#include <utility>

#include "app/perception/detector.h"
#include "app/perception/levels.h"
#include "core/base/statistics.h"

namespace interneuron::perception {
namespace {

// Runs before those that are timed: the first forward of a net allocates memory and is slow, and a
// background model sees nothing but movement in its first images.
constexpr int kWarmUpRuns = 10;
// The most levels of a ladder, because a level travels as one byte.
constexpr std::size_t kAllLevels = 256;
// By how much the motion ladder's AP must be higher for kAuto to take it: APs that are closer
// differ by the video, and the nets need no fixed camera.
constexpr double kClearlyBetter = 0.01;

std::string joined(const std::vector<std::filesystem::path>& files) {
  std::string text;
  for (const auto& file : files) text += (text.empty() ? "" : ", ") + file.filename().string();
  return text;
}

Ladder make_dnn_ladder(std::vector<Level> levels) { return {"dnn (OpenCV)", std::move(levels)}; }

// `why`: nothing, or a clause that begins with "; ".
Ladder make_motion_ladder(const std::string& why, std::size_t levels) {
  return {"motion (built in, fixed cameras only" + why + ")", motion_levels(levels)};
}

// By what the ladders are worth as a whole: one that is cut to its lowest level for a vehicle's
// backup is of the same kind as the roadside's.
Ladder make_auto_ladder(const LadderOptions& options, std::size_t levels) {
  const auto missing = missing_models(options.data_dir);
  if (!missing.empty()) {
    return make_motion_ladder("; no " + joined(missing) + ", run scripts/fetch_data.sh", levels);
  }
  std::vector<Level> nets = dnn_levels(options.data_dir, kAllLevels);
  const double of_nets = expected_quality(nets, options.budget);
  const double of_motion = expected_quality(motion_levels(kAllLevels), options.budget);
  if (options.budget > Duration::zero() && of_motion > of_nets + kClearlyBetter) {
    char why[96];
    std::snprintf(why, sizeof why, "; AP %.2f within %.0f ms, dnn %.2f", of_motion,
                  to_ms(options.budget), of_nets);
    return make_motion_ladder(why, levels);
  }
  if (nets.size() > levels) nets.resize(levels);
  return make_dnn_ladder(std::move(nets));
}

Ladder make_replay_ladder(const LadderOptions& options, std::size_t levels) {
  return {"replay (recorded boxes of the demo video)",
          replay_levels(options.data_dir, levels, options.spend), true};
}

}  // namespace

Ladder::Ladder(std::string title, std::vector<Level> levels, bool times_known)
    : title_(std::move(title)), levels_(std::move(levels)), times_known_(times_known) {
  assert(!levels_.empty() && levels_.size() <= kAllLevels);
}

void Ladder::calibrate(std::span<const Image> images, int runs, const Progress& progress,
                       Duration pause) {
  if (images.empty() || runs < 1) {
    throw InputError("calibration needs at least one frame and one run; give a longer video");
  }
  // A new number for each run: a level that learns from images counts an image of the same number
  // once.
  std::uint32_t number = 0;
  const auto run = [&](Detector& detector) {
    Image image = images[number % images.size()];
    image.frame = number++;
    const auto start = std::chrono::steady_clock::now();
    (void)detector.detect(image);
    return std::chrono::duration_cast<Duration>(std::chrono::steady_clock::now() - start);
  };
  for (std::size_t i = 0; i < levels_.size(); ++i) {
    Level& level = levels_[i];
    if (!times_known_) {
      number = 0;
      level.detector->reset();
      for (int n = 0; n < kWarmUpRuns; ++n) (void)run(*level.detector);
      std::vector<Duration> times;
      for (int n = 0; n < runs; ++n) {
        std::this_thread::sleep_for(pause);
        times.push_back(run(*level.detector));
      }
      level.r_median = percentile(times, 0.5);
      level.r_p95 = percentile(times, 0.95);
      level.detector->reset();
    }
    if (progress) progress(level, i + 1, levels_.size());
  }
}

std::size_t Ladder::top_level(Duration budget) const {
  for (std::size_t i = levels_.size(); i-- > 1;) {
    if (levels_[i].r_p95 > Duration::zero() && levels_[i].r_p95 <= budget) return i;
  }
  return 0;
}

double expected_quality(std::span<const Level> levels, Duration budget) {
  double best = 0;
  for (const Level& level : levels) {
    const bool fits = budget <= Duration::zero() || level.recorded_median <= budget;
    if (fits && !level.quality.empty()) best = std::max(best, level.quality.front());
  }
  return best;
}

std::string Ladder::description() const {
  std::string text = "ladder " + title_ + ":";
  for (std::size_t i = 0; i < levels_.size(); ++i) {
    const Level& level = levels_[i];
    text += (i == 0 ? " L" : ", L") + std::to_string(i) + " " + level.name;
    if (level.r_median <= Duration::zero()) continue;
    char times[64];
    std::snprintf(times, sizeof times, " %.1f/%.1f ms", to_ms(level.r_median), to_ms(level.r_p95));
    text += times;
  }
  if (levels_.front().r_median > Duration::zero()) text += " (median/p95, 1 thread)";
  return text;
}

std::optional<LadderKind> parse_ladder_kind(std::string_view text) {
  if (text == "auto") return LadderKind::kAuto;
  if (text == "dnn") return LadderKind::kDnn;
  if (text == "motion") return LadderKind::kMotion;
  if (text == "replay") return LadderKind::kReplay;
  return {};
}

Ladder make_ladder(const LadderOptions& options) {
  // Only the first call of a process takes effect, because TBB keeps its first limit; so every
  // ladder asks for the same.
  cv::setNumThreads(1);
  const std::size_t levels = options.max_levels == 0 ? kAllLevels : options.max_levels;
  switch (options.kind) {
    case LadderKind::kDnn:
      return make_dnn_ladder(dnn_levels(options.data_dir, levels));
    case LadderKind::kMotion:
      return make_motion_ladder("", levels);
    case LadderKind::kReplay:
      return make_replay_ladder(options, levels);
    case LadderKind::kAuto:
      break;
  }
  return make_auto_ladder(options, levels);
}

}  // namespace interneuron::perception
