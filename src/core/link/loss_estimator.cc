#include "core/link/loss_estimator.h"

#include <algorithm>
#include <cmath>

namespace interneuron::link {
namespace {

constexpr double kBurstMemory = 16;  // runs; chosen
// How many standard errors apart the quick and the slow mean are before it counts as a step; with
// 20 independent looks in 20,000 packets a false alarm is one in 80,000. Chosen.
constexpr double kStepSigmas = 5;
constexpr double kLeastQuick = 200;  // packets before the quick mean is listened to; chosen

// What is left of a mean over `weight` outcomes after `n` more that are all zero: plain mean up to
// `memory`, exponential after it.
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

void LossEstimator::fade(TimePoint now) {
  const Duration age = now - faded_at_;
  if (age < std::chrono::seconds(1)) return;
  faded_at_ = now;
  const double left =
      std::exp(-static_cast<double>(age.count()) / static_cast<double>(kFade.count()));
  weight_ *= left;
  quick_weight_ *= left;
}

void LossEstimator::close_run() {
  if (run_ == 0) return;
  runs_ = std::min(runs_ + 1, kBurstMemory);
  burst_ += (static_cast<double>(run_) - burst_) / runs_;
  run_ = 0;
}

void LossEstimator::follow_steps() {
  if (quick_weight_ < kLeastQuick || weight_ <= quick_weight_) return;
  // Between the two: a mean that is near 0 believes in no spread at all.
  const double p = (slow_ + quick_) / 2;
  // An exponential mean over n is as sure as a plain one over 2n, which it is not yet at the start;
  // losses in runs are fewer facts.
  const double packets = quick_weight_ * (1.0 + quick_weight_ / kQuickMemory);
  const double variance = p * (1.0 - p) / packets * std::max(1.0, 2 * burst() - 1);
  const double off = quick_ - slow_;
  if (off * off <= kStepSigmas * kStepSigmas * variance) return;
  slow_ = quick_;
  weight_ = quick_weight_;
}

}  // namespace interneuron::link
