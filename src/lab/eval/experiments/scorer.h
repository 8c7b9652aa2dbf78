// What the boxes were worth that an application got in simulated rounds: COCO's AP and AR of the
// recorded detections against the ground truth of the demo video, whose frames the rounds show in
// turn.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/perception/accuracy.h"
#include "app/perception/detection.h"
#include "lab/eval/quality.h"
#include "lab/eval/run.h"

namespace interneuron::experiments {

// Frames of the demo video.
inline constexpr std::uint32_t kVideoFrames = 795;

// What was shown in a round, and of which system's round.
struct ShownRound {
  std::uint32_t round = 0;
  eval::Shown shown;
};

// Thread-safe once made.
class Scorer {
 public:
  // From <data>/detections, <data>/profile.csv and <data>/pets/gt.txt. Without a folder, recordings
  // or ground truth it scores nothing, and missing() says why. `named`: the user named the folder,
  // so that its absence is an error. Throws process::Failure (1) then, and for damaged files.
  Scorer(const std::optional<std::filesystem::path>& data, bool named);
  ~Scorer();

  // Empty, or one line with the remedy.
  const std::string& missing() const { return missing_; }

  // Nothing when missing(). All rounds are pooled.
  std::optional<perception::Accuracy> score(std::span<const ShownRound> rounds) const;
  // Over the whole video; nothing when missing().
  std::optional<perception::Accuracy> score(std::size_t level, bool sampled) const;

  // The recorded boxes; requires missing().empty().
  std::vector<perception::Box> boxes(std::size_t level, bool sampled, std::uint32_t frame) const;

 private:
  struct Recordings;
  std::unique_ptr<Recordings> recordings_;
  std::string missing_;
};

}  // namespace interneuron::experiments
