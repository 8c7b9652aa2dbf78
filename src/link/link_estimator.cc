#include "link/link_estimator.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace interneuron::link {
namespace {

// 10 s of round trips at 50 per second; chosen.
constexpr std::size_t kMaxSamples = 500;
// Shorter trains are spread by the slots of the radio rather than by its rate (transport.md §4.1).
constexpr std::uint32_t kMinTrainPackets = 16;
// The median of this many trains: one train compressed by a falling delay must not count; chosen.
constexpr std::size_t kTrains = 5;
// A train that arrived at this share of its pacing rate was limited by us, not by the link; chosen.
constexpr double kPacingLimited = 0.85;
// Smoothing of loss per packet: about the last 1,000 packets; chosen.
constexpr double kLossGain = 1e-3;
// Quicker than RFC 6298's 1/8: at 20 samples per second the estimate follows a radio's ramp of 0.1
// to 0.3 s; chosen.
constexpr int kRttGainDivisor = 4;
// Feedback may be this late by itself: its delay (5 ms, src/flow/receiver.h) and a turn of either
// loop; chosen.
constexpr Duration kFeedbackSlack = std::chrono::milliseconds(10);
constexpr Duration kUnknownTimeout =
    std::chrono::milliseconds(200);  // before the first round trip; chosen
constexpr Duration kMinTimeout = std::chrono::milliseconds(20);  // chosen

}  // namespace

void LinkEstimator::round_trip(TimePoint now, Duration rtt) {
  smoothed_ = samples_.empty() ? rtt : smoothed_ + (rtt - smoothed_) / kRttGainDivisor;
  samples_.push_back({now, rtt});
  if (samples_.size() > kMaxSamples) samples_.pop_front();
  refresh(now);
}

void LinkEstimator::refresh(TimePoint now) {
  while (!samples_.empty() && samples_.front().at < now - kMinimumWindow) samples_.pop_front();
  std::vector<Duration> recent;
  min_ = samples_.front().rtt;
  for (const Sample& s : samples_) {
    min_ = std::min(min_, s.rtt);
    if (s.at >= now - kQuantileWindow) recent.push_back(s.rtt);
  }
  const auto quantile = [&recent](double q) {
    // Nearest rank: with few samples the upper quantile is the largest.
    const auto rank =
        static_cast<std::ptrdiff_t>(std::ceil(q * static_cast<double>(recent.size()))) - 1;
    std::nth_element(recent.begin(), recent.begin() + rank, recent.end());
    return recent[static_cast<std::size_t>(rank)];
  };
  median_ = quantile(0.5);
  p95_ = quantile(0.95);
}

void LinkEstimator::acknowledged(std::uint64_t packets) {
  for (std::uint64_t i = 0; i < packets; ++i) loss_ -= kLossGain * loss_;
}

void LinkEstimator::lost(std::uint64_t packets) {
  for (std::uint64_t i = 0; i < packets; ++i) loss_ += kLossGain * (1.0 - loss_);
}

void LinkEstimator::train(std::uint64_t train, std::uint32_t packets, DataRate measured,
                          std::optional<DataRate> paced_at) {
  if (packets < kMinTrainPackets || measured.bits_per_second <= 0) return;
  if (open_train_ && open_train_->id != train) commit_train();
  // The bound of the train's beginning holds to its end, though the estimate (and so the pacing)
  // moves meanwhile.
  const auto bound = open_train_ ? open_train_->paced_at : paced_at;
  open_train_ = Train{train, measured, bound};
  const bool only_a_bound = bound && measured >= bound->scaled(kPacingLimited);
  if (!rate_ || (only_a_bound && measured > *rate_)) rate_ = measured;
}

void LinkEstimator::commit_train() {
  const Train done = *open_train_;
  open_train_.reset();
  const bool only_a_bound = done.paced_at && done.measured >= done.paced_at->scaled(kPacingLimited);
  if (only_a_bound && rate_ && done.measured < *rate_) return;
  trains_.push_back(done.measured);
  if (trains_.size() > kTrains) trains_.pop_front();
  std::vector<DataRate> sorted(trains_.begin(), trains_.end());
  std::ranges::sort(sorted);
  rate_ = sorted[sorted.size() / 2];
}

Duration LinkEstimator::probe_timeout() const {
  if (samples_.empty()) return kUnknownTimeout;
  return std::max(kMinTimeout, p95_ + p95_ / 4 + kFeedbackSlack);
}

LinkState LinkEstimator::state(TimePoint now) const {
  LinkState s;
  s.up = up(now);
  s.rtt_p50 = median_;
  s.rtt_p95 = p95_;
  s.rtt_min = min_;
  s.rate = rate_.value_or(DataRate{});
  s.loss = loss_;
  s.age = heard_at_ ? now - *heard_at_ : Duration::max();
  return s;
}

}  // namespace interneuron::link
