// How far off a path is when it is said when it will have brought something.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>

#include "interneuron/time.h"

namespace interneuron::flow {

// Owned by the Sender, one per path, which tells it of every message or share of one that the path
// has brought, or has not when its time was over. It learns by which part of the time on the air
// predictions were too short, and how much that varies: a path whose rate is steady is off by a few
// hundredths, one of a moving modem by as much as the time itself. What the peer reports decides
// it, which harms what is sent to that peer alone. Constant memory. Pure; thread-compatible.
class CompletionLaw {
 public:
  // What took `air` on the air by what was believed was there so much later than predicted.
  void learn(Duration late, Duration air) {
    if (air < kLeastAir) return;
    const double ratio = std::clamp(to_seconds(late) / to_seconds(air), kLeastRatio, kMostRatio);
    const double off = ratio - mean_;
    mean_ += kGain * off;
    variance_ = (1 - kGain) * (variance_ + kGain * off * off);
  }
  // By which part the air time is too short in the mean, and the standard deviation of that.
  double mean() const { return mean_; }
  double deviation() const { return std::sqrt(variance_); }

 private:
  // The gain of means of round trips (RFC 6298).
  static constexpr double kGain = 1.0 / 8;
  // What is shorter than this says more of the turns of event loops.
  static constexpr Duration kLeastAir = std::chrono::milliseconds(4);
  // Nothing takes less than no time, and a stall is not the path's rate.
  static constexpr double kLeastRatio = -0.9;
  static constexpr double kMostRatio = 4;

  double mean_ = 0;
  // Rates are believed to within 20 % (docs/links.md, "How a link is measured"): two deviations.
  double variance_ = 0.01;
};

}  // namespace interneuron::flow
