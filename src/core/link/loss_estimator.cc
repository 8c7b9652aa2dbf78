#include "core/link/estimators.h"

#include <algorithm>
#include <cmath>

namespace interneuron::link {
namespace {

// Runs that the mean length of a run remembers. No measurement behind this value.
constexpr double kBurstMemory = 32;
// Runs before their spread is believed. No measurement behind this value: fewer may be alike by
// chance.
constexpr double kLeastRuns = 8;
// How many standard errors apart the quick and the slow mean must be to count as a step. The quick
// mean is independent of itself every 1,000 packets; in 20,000 packets a false alarm happens once
// in 80,000 times.
constexpr double kStepSigmas = 5;
// How often evidence fades: more often would cost time and change nothing against kFade.
constexpr Duration kFadeStep = std::chrono::seconds(1);
// Packets before the quick mean is listened to, so that it is more than a few losses.
constexpr double kLeastQuick = 200;

// The factor by which a mean over `weight` outcomes shrinks after `n` more that are all zero. Adds
// them to `weight`: the mean is a plain one up to `memory` outcomes and an exponential one after
// it.
double kept(double& weight, double memory, double n) {
  const double plain = std::min(n, memory - weight);
  double left = 1.0;
  if (plain > 0) {
    left = weight / (weight + plain);
    weight += plain;
    n -= plain;
  }
  if (n > 0) left *= n == 1 ? 1.0 - 1.0 / memory : std::pow(1.0 - 1.0 / memory, n);
  return left;
}

}  // namespace

void LossEstimator::arrived(TimePoint now, std::uint64_t packets) {
  if (packets == 0) return;
  fade(now);
  close_run();
  const auto n = static_cast<double>(packets);
  slow_ *= kept(weight_, kMemory, n);
  quick_ *= kept(quick_weight_, kQuickMemory, n);
  follow_steps();
}

void LossEstimator::lost(TimePoint now, std::uint64_t packets) {
  if (packets == 0) return;
  fade(now);
  run_ += packets;
  const auto n = static_cast<double>(packets);
  slow_ = 1.0 - (1.0 - slow_) * kept(weight_, kMemory, n);
  quick_ = 1.0 - (1.0 - quick_) * kept(quick_weight_, kQuickMemory, n);
  follow_steps();
}

double LossEstimator::burst() const { return runs_ > 0 ? burst_ : static_cast<double>(run_); }

double LossEstimator::burst_deviation() const {
  return runs_ < kLeastRuns ? -1 : std::sqrt(burst_variance_);
}

void LossEstimator::fade(TimePoint now) {
  const Duration age = now - faded_at_.value_or(now);
  if (faded_at_ && age < kFadeStep) return;
  faded_at_ = now;
  const double left =
      std::exp(-static_cast<double>(age.count()) / static_cast<double>(kFade.count()));
  weight_ *= left;
  quick_weight_ *= left;
}

void LossEstimator::close_run() {
  if (run_ == 0) return;
  runs_ = std::min(runs_ + 1, kBurstMemory);
  const double off = static_cast<double>(run_) - burst_;
  burst_ += off / runs_;
  burst_variance_ = (1 - 1 / runs_) * (burst_variance_ + off * off / runs_);
  run_ = 0;
}

void LossEstimator::follow_steps() {
  if (quick_weight_ < kLeastQuick || weight_ <= quick_weight_) return;
  // The mean of both, because by a mean near 0 alone there would be no spread at all.
  const double p = (slow_ + quick_) / 2;
  // An exponential mean over n packets is as sure as a plain one over 2n, but not yet at the start.
  // Losses in runs are not independent, so they count as fewer.
  const double packets = quick_weight_ * (1.0 + quick_weight_ / kQuickMemory);
  const double variance = p * (1.0 - p) / packets * std::max(1.0, 2 * burst() - 1);
  const double off = quick_ - slow_;
  if (off * off <= kStepSigmas * kStepSigmas * variance) return;
  slow_ = quick_;
  weight_ = quick_weight_;
}

}  // namespace interneuron::link
