#include "lab/foreign/congestion.h"

#include <algorithm>
#include <chrono>

namespace interneuron::foreign {
namespace {

using namespace std::chrono_literals;

// All of them from the draft: 2 / ln 2 doubles the rate each round trip, its inverse empties the
// queue again; then a cycle of eight round trips, one of them above the rate and one below.
constexpr double kStartupGain = 2.885;
constexpr double kDrainGain = 1 / kStartupGain;
constexpr std::array kCycle{1.25, 0.75, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0};
constexpr double kWindowGain = 2;
// The pipe is full when the rate has not grown by a quarter in three round trips.
constexpr double kGrowth = 1.25;
constexpr int kFullRounds = 3;
// The least round trip is measured anew after 10 s, with 4 segments in flight for 200 ms.
constexpr Duration kRttLasts = 10s;
constexpr Duration kProbeRttTime = 200ms;
constexpr std::size_t kLeastWindow = std::size_t{4} * kMss;

}  // namespace

DataRate BbrLike::bottleneck_rate() const { return std::ranges::max(rates_); }

std::size_t BbrLike::bandwidth_delay() const {
  return static_cast<std::size_t>(static_cast<double>(bottleneck_rate().bits_per_second) / 8 *
                                  to_seconds(least_rtt_));
}

std::size_t BbrLike::window() const {
  if (bottleneck_rate() == DataRate{}) return kInitialWindow;
  if (phase_ == Phase::kProbeRtt) return kLeastWindow;
  const double gain = phase_ == Phase::kStartup ? kStartupGain : kWindowGain;
  const auto gained = static_cast<std::size_t>(gain * static_cast<double>(bandwidth_delay()));
  return std::max(kLeastWindow, gained);
}

std::optional<DataRate> BbrLike::pacing_rate() const {
  const DataRate rate = bottleneck_rate();
  if (rate == DataRate{}) return std::nullopt;
  switch (phase_) {
    case Phase::kStartup:
      return rate.scaled(kStartupGain);
    case Phase::kDrain:
      return rate.scaled(kDrainGain);
    case Phase::kProbeRate:
      return rate.scaled(kCycle[cycle_]);
    case Phase::kProbeRtt:
      return rate;
  }
  return rate;
}

void BbrLike::learn_rate(const Delivery& d) {
  if (d.round_began) {
    ++round_;
    rates_[round_ % kRounds] = {};
  }
  // A rate that the application held down counts only where it is above what is known.
  if (d.application_limited && d.rate < bottleneck_rate()) return;
  DataRate& now = rates_[round_ % kRounds];
  now = std::max(now, d.rate);
}

void BbrLike::learn_rtt(const Delivery& d) {
  const bool old = least_rtt_ > Duration{} && d.now - least_at_ > kRttLasts;
  if (d.rtt && (least_rtt_ == Duration{} || *d.rtt <= least_rtt_ || old)) {
    least_rtt_ = *d.rtt;
    least_at_ = d.now;
  }
  if (old && phase_ == Phase::kProbeRate) {
    phase_ = Phase::kProbeRtt;
    probe_rtt_until_ = d.now + kProbeRttTime;
  }
}

void BbrLike::look_for_full_pipe(const Delivery& d) {
  if (!d.round_began || d.application_limited) return;
  if (bottleneck_rate() >= full_rate_.scaled(kGrowth)) {
    full_rate_ = bottleneck_rate();
    rounds_without_growth_ = 0;
    return;
  }
  if (++rounds_without_growth_ >= kFullRounds) phase_ = Phase::kDrain;
}

// The next place of the cycle: after a least round trip, above the rate only once the pipe holds
// that much more, below it at the latest when the queue is gone.
void BbrLike::turn(const Delivery& d) {
  const double gain = kCycle[cycle_];
  const bool long_enough = d.now - cycle_began_ > least_rtt_;
  const auto filled = static_cast<std::size_t>(gain * static_cast<double>(bandwidth_delay()));
  const bool drained = gain < 1 && d.in_flight <= bandwidth_delay();
  const bool is_full = d.in_flight >= filled || lost_in_cycle_ || d.application_limited;
  const bool over = gain > 1 ? long_enough && is_full : long_enough || drained;
  if (!over) return;
  lost_in_cycle_ = false;
  cycle_ = (cycle_ + 1) % kCycle.size();
  cycle_began_ = d.now;
}

void BbrLike::delivered(const Delivery& d) {
  learn_rate(d);
  learn_rtt(d);
  if (phase_ == Phase::kStartup) look_for_full_pipe(d);
  if (phase_ == Phase::kDrain && d.in_flight <= bandwidth_delay()) {
    phase_ = Phase::kProbeRate;
    cycle_ = 2;
    cycle_began_ = d.now;
  }
  if (phase_ == Phase::kProbeRate) turn(d);
  if (phase_ == Phase::kProbeRtt && d.now >= probe_rtt_until_) {
    phase_ = Phase::kProbeRate;
    least_at_ = d.now;
  }
}

}  // namespace interneuron::foreign
