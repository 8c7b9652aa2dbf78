// A rate-based control after BBR (draft-cardwell-iccrg-bbr-congestion-control-00, version 1): it
// paces at the greatest rate of delivery of the last ten round trips, probes for more by gains of
// 1.25 and 0.75, and bounds what is in flight by twice rate times least round trip. Called "like"
// because it has no long-term sampling for policers and no bursts of the sending host to make up
// for. Losses and marks do not lower its rate, as in version 1. Pure; thread-compatible; no errors.
#pragma once

#include <array>
#include <optional>

#include "lab/foreign/congestion.h"

namespace interneuron::foreign {

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
