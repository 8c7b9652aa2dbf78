// The round-trip time of one cellular link while driving, as a process in time. Two models:
//
//   three-state (docs/constants.md, "Three-state model"): a semi-Markov chain STABLE -> EDGE ->
//   {BAD
//     with probability q | STABLE}, BAD -> STABLE, with Gamma sojourns, a level per episode, an
//     AR(1) wander within it, a first-order ramp between episodes and a half-normal jitter per
//     step. Its long-run mean, minimum, maximum and standard deviation equal the paper's network
//     table.
//   delay-trace: measured round-trip times, see delay_trace.h. Always in state STABLE.
//
// Both directions of a link read the same process, half of it each, since the table has round
// trips. Thread-compatible; pure. The same parameters and seed give the same process, whoever reads
// it and how often. Processes may share their fading: see common_fading.h.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>

#include "core/base/ring.h"
#include "interneuron/time.h"
#include "lab/emu/delay_trace.h"

namespace interneuron::emu {

class CommonFading;

enum class RadioState : std::uint8_t { kStable, kEdge, kBad };
inline constexpr std::size_t kRadioStates = 3;

struct RadioStateParams {
  double level_ms = 0;      // mean of the episode's level
  double level_sd_ms = 0;   // its spread over episodes
  double ar_sd_ms = 0;      // stationary sd of the wander within an episode
  double ar_tau_s = 1;      // its correlation time, > 0
  double jitter_sd_ms = 0;  // half-normal, per step
  double sojourn_mean_s = 1;
  double sojourn_shape = 2;  // of the Gamma distribution
  double loss = 0;           // probability per packet and direction
};

struct DelayParams {
  std::array<RadioStateParams, kRadioStates> states{};  // indexed by RadioState
  double bad_after_edge = 0;                            // q
  double ramp_tau_s = 0.1;                              // > 0
  double min_ms = 0;  // the process is clipped to [min_ms, max_ms]
  double max_ms = 0;
  // Set: the model is delay-trace; of the above only states[kStable].loss counts.
  std::shared_ptr<const DelayTrace> trace;
  bool random_start = false;  // begin somewhere in the trace, which the seed chooses
};

// A round-trip time that never changes.
DelayParams constant_delay(double rtt_ms, double loss);

// Steps of the process; between two steps the value holds.
inline constexpr Duration kDelayStep = std::chrono::milliseconds(10);

class DelayProcess {
 public:
  DelayProcess(const DelayParams& params, std::uint64_t seed);
  ~DelayProcess();
  DelayProcess(const DelayProcess&) = delete;  // others may be coupled to it
  DelayProcess& operator=(const DelayProcess&) = delete;

  struct Sample {
    Duration rtt{};
    RadioState state{};
    bool out = false;  // no network
    double loss = 0;
  };

  // The process at `t` since its start (negative t reads as 0). Calls may go back by up to kMemory;
  // older instants read the oldest sample still kept. Constant time for what is already made; a
  // jump ahead makes every step between.
  Sample at(Duration t);

  static constexpr Duration kMemory = std::chrono::seconds(10);

 private:
  friend class CommonFading;

  // RadioStateParams in units of one step.
  struct Coefficients {
    double keep = 0;           // of the wander, over one step
    double innovation_ms = 0;  // sd of what is added to it
  };

  std::int64_t made() const { return first_index_ + static_cast<std::int64_t>(samples_.size()); }
  void make_step();
  bool end_episode();  // true: EDGE begins now
  void append_sample();
  Sample trace_sample() const;
  Sample state_sample();
  void enter(RadioState next);
  void leave();
  double normal(double sd);
  double uniform();

  DelayParams params_;
  std::array<Coefficients, kRadioStates> coefficients_{};
  double ramp_gain_ = 0;
  Duration trace_start_{};
  std::mt19937_64 rng_;
  std::normal_distribution<double> unit_normal_{0.0, 1.0};
  RadioState state_ = RadioState::kStable;
  std::int64_t steps_left_ = 0;  // of the present episode
  double level_ms_ = 0;
  double wander_ms_ = 0;
  double ramped_ms_ = 0;
  Duration last_rtt_{};
  std::int64_t first_index_ = 0;  // index of samples_.front()
  Ring<Sample> samples_;          // at most kMemory + one step
  std::shared_ptr<CommonFading> fading_;
};

}  // namespace interneuron::emu
