#include "lab/eval/experiments/scorer.h"

#include <algorithm>
#include <array>
#include <map>
#include <tuple>

#include "app/perception/codec.h"
#include "app/perception/detector.h"
#include "app/process/failure.h"
#include "app/settings/data.h"

namespace interneuron::experiments {
namespace {

namespace fs = std::filesystem;
using eval::Shown;
using perception::Variant;

// Boxes of one frame, by level and variant.
using Frames = std::vector<std::vector<perception::Box>>;

// What the replay detector tells a raw image from a sampled one by is its width.
perception::Image image_of(bool sampled, std::uint32_t frame) {
  const int width = sampled ? perception::kSampledWidth : perception::kRawWidth;
  return {.bgr = cv::Mat(1, width, CV_8UC3),
          .variant = sampled ? Variant::kSampled : Variant::kRaw,
          .frame = frame};
}

}  // namespace

struct Scorer::Recordings {
  Recordings(const fs::path& data, const fs::path& truth_file)
      : truth(perception::read_mot_truth(truth_file)) {
    perception::Ladder ladder = perception::make_ladder(
        {.kind = perception::LadderKind::kReplay, .data_dir = data, .spend = [](Duration) {}});
    levels.resize(ladder.size());
    for (std::size_t level = 0; level < ladder.size(); ++level) {
      for (const bool sampled : {false, true}) {
        for (std::uint32_t frame = 0; frame < kVideoFrames; ++frame) {
          levels[level][sampled].push_back(ladder.detect(level, image_of(sampled, frame)));
        }
      }
    }
  }

  // By level, then whether the image is sampled, then by frame.
  std::vector<std::array<Frames, 2>> levels;
  perception::GroundTruth truth;
};

Scorer::Scorer(const std::optional<fs::path>& data, bool named) {
  const std::optional<fs::path> truth = settings::default_truth(data);
  if (!data) {
    missing_ = "no recorded detections";
  } else if (!fs::is_directory(*data / "detections")) {
    missing_ = "no recorded detections in '" + data->string() + "'";
  } else if (!truth) {
    missing_ = "no ground truth in '" + data->string() + "'";
  }
  if (!missing_.empty()) {
    missing_ +=
        "; fetch the data with scripts/fetch_data.sh --ground-truth or name them with --data";
    if (named) throw process::Failure(process::kConfiguration, missing_);
    return;
  }
  try {
    recordings_ = std::make_unique<Recordings>(*data, *truth);
  } catch (const perception::InputError& error) {
    throw process::Failure(process::kConfiguration, error.what());
  }
}

Scorer::~Scorer() = default;

std::vector<perception::Box> Scorer::boxes(std::size_t level, bool sampled,
                                           std::uint32_t frame) const {
  return recordings_->levels.at(level)[sampled][frame % kVideoFrames];
}

std::optional<perception::Accuracy> Scorer::score(std::span<const ShownRound> rounds) const {
  if (!recordings_) return std::nullopt;
  // Seeds show the same frames, so the same boxes come many times.
  using Key = std::tuple<std::uint32_t, Shown::Kind, std::size_t, bool, std::uint32_t>;
  std::map<Key, std::size_t> times;
  for (const ShownRound& r : rounds) {
    const std::uint32_t age = std::min(r.shown.age, r.round);
    ++times[{r.round % kVideoFrames, r.shown.kind, r.shown.level, r.shown.variant != 0, age}];
  }
  std::vector<perception::Shown> shown;
  for (const auto& [key, count] : times) {
    const auto& [frame, kind, level, sampled, age] = key;
    perception::Shown one{.frame = static_cast<int>(frame), .times = count};
    if (kind == Shown::Kind::kLocal) one.boxes = boxes(0, false, frame);
    if (kind == Shown::Kind::kRemote) one.boxes = boxes(level, sampled, frame);
    if (kind == Shown::Kind::kStale) {
      one.boxes = boxes(level, sampled, frame + kVideoFrames - age % kVideoFrames);
    }
    shown.push_back(std::move(one));
  }
  return perception::evaluate(recordings_->truth, shown);
}

std::optional<perception::Accuracy> Scorer::score(std::size_t level, bool sampled) const {
  std::vector<ShownRound> rounds;
  for (std::uint32_t frame = 0; frame < kVideoFrames; ++frame) {
    rounds.push_back({frame, {Shown::Kind::kRemote, level, std::uint8_t{sampled}, 0}});
  }
  return score(rounds);
}

}  // namespace interneuron::experiments
