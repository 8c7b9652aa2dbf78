// The round-trip time of one cellular link while driving, as a process in time. Two models:
//
//   three-state: a semi-Markov chain. From STABLE it goes to EDGE, from EDGE with probability q to
//     BAD and else back to STABLE, from BAD to STABLE. A stay (an episode) lasts a time with a
//     Gamma distribution and draws a level; within it an AR(1) process varies around the level;
//     from one level to the next leads a first-order ramp; each step adds half-normal jitter. With
//     the parameters of 4g.toml and 5g.toml the mean, minimum, maximum and standard deviation in
//     the long run are those of the paper's network table (docs/constants.md, "Three-state model").
//   delay-trace: measured round-trip times, see delay_trace.h. Always in the state STABLE.
//
// Both directions of a link read the same process and take half of it each, since the table has
// round trips. The same parameters and seed give the same values, whoever reads them and how often.
// Several processes may share their fading: see couple(). Memory: the last 10 s, 1000
// samples. Pure; thread-compatible; no errors.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <span>

#include "core/base/ring.h"
#include "interneuron/time.h"

namespace interneuron::emu {

class CommonFading;
struct DelayTrace;

enum class RadioState : std::uint8_t { kStable, kEdge, kBad };
inline constexpr std::size_t kRadioStates = 3;

struct RadioStateParams {
  // The level of an episode: its mean and its standard deviation over episodes.
  double level_ms = 0;
  double level_sd_ms = 0;
  // The AR(1) process within an episode: its stationary standard deviation and its correlation
  // time, which is above 0.
  double ar_sd_ms = 0;
  double ar_tau_s = 1;
  // The standard deviation of the normal distribution whose absolute values are the jitter.
  double jitter_sd_ms = 0;
  // The length of an episode: mean and shape of the Gamma distribution.
  double sojourn_mean_s = 1;
  double sojourn_shape = 2;
  // Probability per packet and direction.
  double loss = 0;
};

struct DelayParams {
  // Indexed by RadioState.
  std::array<RadioStateParams, kRadioStates> states{};
  // q, the probability that BAD follows EDGE.
  double bad_after_edge = 0;
  // The time constant of the ramp between levels, above 0.
  double ramp_tau_s = 0.1;
  // Values are clipped to [min_ms, max_ms].
  double min_ms = 0;
  double max_ms = 0;
  // When set, the model is delay-trace, and of the fields above only states[kStable].loss counts.
  std::shared_ptr<const DelayTrace> trace;
  // The trace begins at a place that the seed decides, instead of at its beginning.
  bool random_start = false;
};

// A round-trip time that never changes.
DelayParams constant_delay(double rtt_ms, double loss);

// The length of a step of the process. Within a step its value stays the same.
inline constexpr Duration kDelayStep = std::chrono::milliseconds(10);

class DelayProcess {
 public:
  DelayProcess(const DelayParams& params, std::uint64_t seed);
  ~DelayProcess();
  // Coupled processes know each other by address.
  DelayProcess(const DelayProcess&) = delete;
  DelayProcess& operator=(const DelayProcess&) = delete;

  struct Sample {
    Duration rtt{};
    RadioState state{};
    // The trace had no network at this time.
    bool out = false;
    double loss = 0;
  };

  // The process at `t` since its start; a negative `t` counts as 0. Calls may go back by up to
  // kMemory; for older instants the result is the oldest sample kept. A call beyond the newest
  // step makes all steps up to `t`; others take constant time.
  Sample at(Duration t);

  static constexpr Duration kMemory = std::chrono::seconds(10);

 private:
  friend class CommonFading;

  // The AR(1) process per step: the factor that keeps a part of its value, and the standard
  // deviation of what is added.
  struct Coefficients {
    double keep = 0;
    double innovation_ms = 0;
  };

  std::int64_t made() const { return first_index_ + static_cast<std::int64_t>(samples_.size()); }
  void make_step();
  // True when EDGE begins with this step.
  bool end_episode();
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
  // What is left of the present episode, and its values.
  std::int64_t steps_left_ = 0;
  double level_ms_ = 0;
  double wander_ms_ = 0;
  double ramped_ms_ = 0;
  Duration last_rtt_{};
  // The number of the step that samples_.front() is of.
  std::int64_t first_index_ = 0;
  // At most kMemory and one step.
  Ring<Sample> samples_;
  // Empty unless coupled.
  std::shared_ptr<CommonFading> fading_;
};

// Common fading of several links: when one link enters EDGE, each other that is STABLE enters EDGE
// as well with probability c, as if both modems drove behind the same hill. With c = 0 links are
// independent, as was measured in town; in the country bad times came together four times as often
// as by chance (docs/constants.md, "Three-state model").
//
// Coupled processes make their steps together, in the order given, so that their values do not
// depend on which is read first and how far. Coupling makes EDGE more frequent than the profile
// says, so the long-run figures of a coupled link are worse than the profile's. An entry caused by
// another link causes no further ones in the same step. One thread uses all coupled links. The
// coupling lives as long as one of its processes, and none owns another.
//
// Couples processes that have not been read yet, for as long as they live. c in [0, 1]; with 0, or
// fewer than two, nothing changes. A process belongs to at most one group.
void couple(std::span<const std::shared_ptr<DelayProcess>> processes, double c, std::uint64_t seed);

}  // namespace interneuron::emu
