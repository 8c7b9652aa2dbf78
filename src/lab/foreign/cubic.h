// CUBIC (RFC 9438) with fast convergence, in bytes. Slow start is that of RFC 5681 without HyStart.
// A mark counts as a loss (RFC 3168). Pure; thread-compatible; no errors.
#pragma once

#include <optional>

#include "lab/foreign/congestion.h"

namespace interneuron::foreign {

// RFC 9438, section 4.6 and section 5: the factor of a reduction, and the constant of growth in
// segments per second cubed.
inline constexpr double kCubicBeta = 0.7;
inline constexpr double kCubicC = 0.4;

class Cubic final : public CongestionControl {
 public:
  void delivered(const Delivery& delivery) override;
  void congested(Duration now) override;
  void timed_out(Duration now) override;
  void restarted(Duration idle, Duration retransmission_timeout) override;
  std::size_t window() const override;

 private:
  bool in_slow_start() const { return window_ < threshold_; }
  void reduce();
  void avoid_congestion(const Delivery& delivery, double acked);
  double cubic(double seconds) const;

  // In segments, as in the RFC: cwnd, ssthresh, W_max, cwnd_prior, K in seconds and W_est.
  double window_ = static_cast<double>(kInitialWindow) / kMss;
  double threshold_ = 1e18;
  double top_ = 0;
  double prior_ = 0;
  double inflection_ = 0;
  double reno_ = 0;
  // When the stage of congestion avoidance began; nothing: it begins with the next delivery.
  std::optional<Duration> epoch_{};
  // The stage follows a reduction, so that the curve aims at W_max.
  bool reduced_ = false;
};

}  // namespace interneuron::foreign
