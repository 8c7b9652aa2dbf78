#include "app/computing/level_times.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "core/base/statistics.h"

namespace interneuron::computing {

LevelTimes::LevelTimes(std::vector<LevelProfile> levels)
    : levels_(std::move(levels)), runs_(levels_.size()) {
  assert(!levels_.empty());
}

void LevelTimes::learn(std::size_t level, Duration took) {
  assert(level < levels_.size());
  Ring<Duration>& runs = runs_[level];
  runs.push_back(took);
  if (runs.size() > kRemembered) runs.pop_front();
}

Duration LevelTimes::p95(std::size_t level) const {
  assert(level < levels_.size());
  const Ring<Duration>& runs = runs_[level];
  if (runs.size() < kFewest) return levels_[level].p95;
  std::vector<Duration> times;
  for (std::size_t i = 0; i < runs.size(); ++i) times.push_back(runs[i]);
  return std::max(levels_[level].p95, percentile(std::move(times), 0.95));
}

Duration LevelTimes::least() const {
  Duration least = levels_.front().median;
  const Ring<Duration>& runs = runs_.front();
  for (std::size_t i = 0; i < runs.size(); ++i) least = std::min(least, runs[i]);
  return least;
}

std::size_t LevelTimes::highest_within(Duration time) const {
  std::size_t highest = 0;
  for (std::size_t level = 0; level < levels_.size(); ++level) {
    if (p95(level) <= time) highest = level;
  }
  return highest;
}

}  // namespace interneuron::computing
