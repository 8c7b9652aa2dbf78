// How long the levels of a computation take on this host: as they were calibrated, or as the newest
// runs in operation took if those were slower, since in operation other programs share the
// processor. The levels are ordered from the lowest quality to the highest; quality and median stay
// as given, the 95th percentile is learnt.
//
// Keeps at most kRemembered run times per level, so its memory is bounded by the number of levels.
// Fed by RoadsideUnit with run times measured on this host, one LevelTimes for each peer: how long
// a level takes depends on the image too, and nobody's images may make another's levels look slow.
// Thread-compatible; pure.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/base/ring.h"
#include "interneuron/guard.h"

namespace interneuron::computing {

class LevelTimes {
 public:
  // The newest run times of a level that its 95th percentile is computed from: 4 s at 10 rounds per
  // second, and enough that the slowest single run is not the percentile.
  static constexpr std::size_t kRemembered = 40;
  // With fewer run times than this the calibration alone counts.
  static constexpr std::size_t kFewest = 3;

  // `levels` is not empty.
  explicit LevelTimes(std::vector<LevelProfile> levels);

  std::span<const LevelProfile> levels() const { return levels_; }
  // A run at `level` took so long; level < levels().size().
  void learn(std::size_t level, Duration took);
  // The larger of the calibrated 95th percentile and that of the remembered runs.
  Duration p95(std::size_t level) const;
  // The least that a computation takes: the median of the lowest level, or the quickest of its
  // remembered runs if that was quicker.
  Duration least() const;
  // The highest level whose 95th percentile is at most `time`; level 0 if none is that quick.
  std::size_t highest_within(Duration time) const;

 private:
  std::vector<LevelProfile> levels_;
  std::vector<Ring<Duration>> runs_;
};

}  // namespace interneuron::computing
