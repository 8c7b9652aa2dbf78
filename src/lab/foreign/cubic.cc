#include "lab/foreign/congestion.h"

#include <algorithm>
#include <cmath>

namespace interneuron::foreign {
namespace {

// The least threshold and the window after a timeout, in segments (RFC 5681, section 3.1).
constexpr double kLeastThreshold = 2;
constexpr double kLossWindow = 1;
// The target of one round trip is at most this much of the window (RFC 9438, section 4.4).
constexpr double kMostGrowth = 1.5;

}  // namespace

std::size_t Cubic::window() const {
  return static_cast<std::size_t>(std::max(kLossWindow, window_) * kMss);
}

double Cubic::cubic(double seconds_since_epoch) const {
  const double t = seconds_since_epoch - inflection_;
  return kCubicC * t * t * t + top_;
}

void Cubic::delivered(const Delivery& d) {
  const double acked = static_cast<double>(d.bytes) / kMss;
  const double peak = static_cast<double>(d.peak_in_flight) / kMss;
  // A window that was not used says nothing of the path (RFC 9438, section 4.2). In slow start half
  // of it is enough, or it could not double.
  if (in_slow_start()) {
    if (window_ < 2 * peak) window_ = std::min(window_ + acked, std::max(threshold_, window_));
    return;
  }
  if (window_ <= peak + 1) avoid_congestion(d, acked);
}

void Cubic::avoid_congestion(const Delivery& d, double acked) {
  if (!epoch_) {
    epoch_ = d.now;
    if (!reduced_ || top_ < window_) top_ = window_;
    reduced_ = false;
    inflection_ = std::cbrt((top_ - window_) / kCubicC);
    reno_ = window_;
  }
  const double t = to_seconds(d.now - *epoch_);
  const double alpha = reno_ < prior_ ? 3 * (1 - kCubicBeta) / (1 + kCubicBeta) : 1;
  reno_ += alpha * acked / window_;
  if (cubic(t) < reno_) {
    window_ = std::max(window_, reno_);
    return;
  }
  const double target =
      std::clamp(cubic(t + to_seconds(d.smoothed_rtt)), window_, kMostGrowth * window_);
  window_ += (target - window_) / window_ * acked;
}

void Cubic::reduce() {
  prior_ = window_;
  // Fast convergence (RFC 9438, section 4.7): who has less than before leaves room to others.
  top_ = window_ < top_ ? window_ * (1 + kCubicBeta) / 2 : window_;
  threshold_ = std::max(kLeastThreshold, window_ * kCubicBeta);
  epoch_.reset();
}

void Cubic::congested(Duration) {
  reduce();
  window_ = threshold_;
  reduced_ = true;
}

void Cubic::timed_out(Duration) {
  reduce();
  window_ = kLossWindow;
  // RFC 9438, section 4.8: the next stage begins as if without a loss before.
  reduced_ = false;
}

void Cubic::restarted(Duration idle, Duration retransmission_timeout) {
  // RFC 5681, section 4.1.
  if (idle > retransmission_timeout) {
    window_ = std::min(window_, static_cast<double>(kInitialWindow) / kMss);
  }
  // Time in which nothing was sent is not time in which the window could have grown.
  if (epoch_) *epoch_ += idle;
}

}  // namespace interneuron::foreign
