// How much may be in flight on a subflow, and how fast it leaves: the rule that tells one TCP from
// another. The subflow tells it of what arrives and what is lost, and asks for the window. Sizes
// are payload bytes. Implementations are pure and belong to one subflow.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "interneuron/units.h"
#include "lab/foreign/segment.h"

namespace interneuron::foreign {

// RFC 6928.
inline constexpr std::size_t kInitialWindow = std::size_t{10} * kMss;

// What an acknowledgement has shown.
struct Delivery {
  Duration now{};
  // That had not been known to have arrived.
  std::size_t bytes = 0;
  // The most that was in flight within the last round trip.
  std::size_t peak_in_flight = 0;
  Duration smoothed_rtt{};
  // That of the newest segment; nothing when it was sent more than once.
  std::optional<Duration> rtt{};
  // The rate at which segments arrived while the newest one was on its way; 0: not known.
  DataRate rate{};
  // The application had nothing to send then, so that the rate says nothing of the path.
  bool application_limited = false;
  // The newest segment was sent after the first one of the round trip before had arrived: a round
  // trip has passed.
  bool round_began = false;
  // What is in flight after it.
  std::size_t in_flight = 0;
};

class CongestionControl {
 public:
  virtual ~CongestionControl() = default;
  virtual void delivered(const Delivery& delivery) = 0;
  // Something was lost or marked; at most once for each window of data.
  virtual void congested(Duration now) = 0;
  // Nothing was heard for the retransmission timeout.
  virtual void timed_out(Duration now) = 0;
  // The subflow sends again after it had nothing in flight for `idle`.
  virtual void restarted(Duration idle, Duration retransmission_timeout) = 0;
  // The most that may be in flight.
  virtual std::size_t window() const = 0;
  // Segments leave no faster than this; nothing: as the window allows.
  virtual std::optional<DataRate> pacing_rate() const { return std::nullopt; }
};

// RFC 9438, section 4.6 and section 5: the factor of a reduction, and the constant of growth in
// segments per second cubed.
inline constexpr double kCubicBeta = 0.7;
inline constexpr double kCubicC = 0.4;

// CUBIC (RFC 9438) with fast convergence, in bytes. Slow start is that of RFC 5681 without HyStart.
// A mark counts as a loss (RFC 3168).
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

// A rate-based control after BBR (draft-cardwell-iccrg-bbr-congestion-control-00, version 1): it
// paces at the greatest rate of delivery of the last ten round trips, probes for more by gains of
// 1.25 and 0.75, and bounds what is in flight by twice rate times least round trip. Called "like"
// because it has no long-term sampling for policers and no bursts of the sending host to make up
// for. Losses and marks do not lower its rate, as in version 1. Pure; thread-compatible; no errors.
class BbrLike final : public CongestionControl {
 public:
  void delivered(const Delivery& delivery) override;
  // Says only that the path holds no more, so that probing may end.
  void congested(Duration) override { lost_in_cycle_ = true; }
  void timed_out(Duration) override {}
  void restarted(Duration, Duration) override {}
  std::size_t window() const override;
  std::optional<DataRate> pacing_rate() const override;

  // What it believes of the path; 0 while nothing was measured.
  DataRate bottleneck_rate() const;

 private:
  enum class Phase : std::uint8_t { kStartup, kDrain, kProbeRate, kProbeRtt };

  std::size_t bandwidth_delay() const;
  void learn_rate(const Delivery& delivery);
  void learn_rtt(const Delivery& delivery);
  void look_for_full_pipe(const Delivery& delivery);
  void turn(const Delivery& delivery);

  static constexpr std::size_t kRounds = 10;

  Phase phase_ = Phase::kStartup;
  // The greatest rate of each of the last round trips.
  std::array<DataRate, kRounds> rates_{};
  std::uint64_t round_ = 0;
  Duration least_rtt_{};
  // When it was last as low as that.
  Duration least_at_{};
  // Start-up: the rate to be exceeded, and for how many round trips it was not.
  DataRate full_rate_{};
  int rounds_without_growth_ = 0;
  // The place in the cycle of gains, and since when.
  std::size_t cycle_ = 0;
  Duration cycle_began_{};
  bool lost_in_cycle_ = false;
  Duration probe_rtt_until_{};
};

}  // namespace interneuron::foreign
