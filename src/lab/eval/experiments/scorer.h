// What the boxes were worth that an application got in simulated rounds: COCO's AP and AR of the
// recorded detections against the ground truth of the demo video, whose frames the rounds show in
// turn; and what the clusters of sweeps were worth.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/perception/accuracy.h"
#include "app/perception/clusters.h"
#include "app/perception/detection.h"
#include "app/perception/point_cloud.h"
#include "app/process/progress.h"
#include "lab/eval/lidar.h"
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

// What the clusters were worth that an application got in simulated rounds of the lidar pipeline:
// every sweep is really encoded, decoded and clustered, and what was shown is compared with what
// the best level finds on the whole sweep of that round. Rounds show the sweeps of a synthetic
// drive in turn (perception::MovedSweeps). Thread-safe once made.
class CloudScorer {
 public:
  // Reads <data>/pointcloud and finds the clusters of all sweeps that so many rounds show, on every
  // variant and level: some ten seconds of processor time for a lap. Without the file it scores
  // nothing, and missing() says why. Throws process::Failure for a damaged file, and when
  // interrupted.
  CloudScorer(const std::optional<std::filesystem::path>& data, eval::LidarSweep sweep,
              std::uint32_t rounds, process::Progress& progress);

  // Empty, or one line with the remedy.
  const std::string& missing() const { return missing_; }

  // The mean agreement of the rounds; a round that shows nothing counts as 0. Nothing when
  // missing(), or without rounds. Requires: no round is beyond those that the scorer was made for.
  std::optional<double> agreement(std::span<const ShownRound> rounds) const;

 private:
  using Clusters = std::vector<perception::Cluster>;

  const Clusters& found(std::uint32_t sweep, std::size_t variant, std::size_t level) const {
    return found_[(sweep * variants_ + variant) * levels_ + level];
  }
  double agreement_of(std::uint32_t round, const eval::Shown& shown) const;

  std::string missing_;
  std::size_t variants_;
  std::size_t levels_;
  // By sweep, then variant, then level.
  std::vector<Clusters> found_;
};

}  // namespace interneuron::experiments
