#include "lab/emu/delay_process.h"

#include <algorithm>
#include <cmath>

#include "lab/emu/common_fading.h"
#include "lab/emu/random.h"

namespace interneuron::emu {

namespace {

constexpr double kStepSeconds = to_seconds(kDelayStep);
constexpr std::size_t kKeptSamples = DelayProcess::kMemory / kDelayStep + 1;

// A sojourn in steps is bounded, so that absurd parameters cannot overflow the counter (10^12 steps
// = 317 years).
constexpr double kMaxSojournSteps = 1e12;

double decay(double tau_s) { return tau_s > 0 ? std::exp(-kStepSeconds / tau_s) : 0.0; }

}  // namespace

DelayParams constant_delay(double rtt_ms, double loss) {
  DelayParams params;
  RadioStateParams only_state;
  only_state.level_ms = rtt_ms;
  // Any value would do, as all states are alike.
  only_state.sojourn_mean_s = 86'400;
  only_state.loss = loss;
  params.states.fill(only_state);
  params.min_ms = params.max_ms = rtt_ms;
  return params;
}

DelayProcess::DelayProcess(const DelayParams& params, std::uint64_t seed)
    : params_(params), rng_(seed) {
  if (params_.trace) {
    if (params_.random_start) {
      const double share = RandomStream(seed).uniform();
      trace_start_ = Duration{
          static_cast<std::int64_t>(share * static_cast<double>(params_.trace->length().count()))};
    }
    append_sample();
    return;
  }
  for (std::size_t i = 0; i < kRadioStates; ++i) {
    const RadioStateParams& p = params_.states[i];
    const double keep = decay(p.ar_tau_s);
    // Keeps the stationary sd of an AR(1) at ar_sd_ms.
    coefficients_[i] = {keep, p.ar_sd_ms * std::sqrt(1 - keep * keep)};
  }
  ramp_gain_ = 1 - decay(params_.ramp_tau_s);

  enter(RadioState::kStable);
  // The drive starts somewhere within an episode, not at its beginning: what is left of it is
  // uniform.
  steps_left_ = static_cast<std::int64_t>(static_cast<double>(steps_left_) * uniform()) + 1;
  append_sample();
}

DelayProcess::~DelayProcess() {
  if (fading_) fading_->remove(*this);
}

DelayProcess::Sample DelayProcess::at(Duration t) {
  const std::int64_t index = std::max<std::int64_t>(0, t / kDelayStep);
  while (made() <= index) make_step();
  return samples_[static_cast<std::size_t>(std::max<std::int64_t>(0, index - first_index_))];
}

void DelayProcess::make_step() {
  if (fading_) return fading_->make_step();
  end_episode();
  append_sample();
}

bool DelayProcess::end_episode() {
  if (params_.trace || steps_left_ > 0) return false;
  leave();
  return state_ == RadioState::kEdge;
}

void DelayProcess::append_sample() {
  Sample sample = params_.trace ? trace_sample() : state_sample();
  // A radio bearer is first in, first out: what is sent one step later never arrives earlier.
  if (!samples_.empty()) sample.rtt = std::max(sample.rtt, last_rtt_ - kDelayStep);
  last_rtt_ = sample.rtt;
  samples_.push_back(sample);
  if (samples_.size() > kKeptSamples) {
    samples_.pop_front();
    ++first_index_;
  }
}

DelayProcess::Sample DelayProcess::trace_sample() const {
  const DelayTrace::Sample now = params_.trace->at(trace_start_ + made() * kDelayStep);
  return {from_ms(now.rtt_ms), RadioState::kStable, now.out, params_.states[0].loss};
}

DelayProcess::Sample DelayProcess::state_sample() {
  --steps_left_;
  const auto i = static_cast<std::size_t>(state_);
  wander_ms_ = coefficients_[i].keep * wander_ms_ + normal(coefficients_[i].innovation_ms);
  const double target_ms = level_ms_ + wander_ms_;
  ramped_ms_ = samples_.empty() ? target_ms : ramped_ms_ + ramp_gain_ * (target_ms - ramped_ms_);

  const double jitter_ms = std::abs(normal(params_.states[i].jitter_sd_ms));
  const double rtt_ms = std::clamp(ramped_ms_ + jitter_ms, params_.min_ms, params_.max_ms);
  return {from_ms(rtt_ms), state_, false, params_.states[i].loss};
}

void DelayProcess::enter(RadioState next) {
  state_ = next;
  const RadioStateParams& p = params_.states[static_cast<std::size_t>(next)];
  std::gamma_distribution<double> sojourn_s(p.sojourn_shape, p.sojourn_mean_s / p.sojourn_shape);
  const double steps = std::min(sojourn_s(rng_) / kStepSeconds, kMaxSojournSteps);
  steps_left_ = std::max<std::int64_t>(1, static_cast<std::int64_t>(steps));
  level_ms_ = std::max(params_.min_ms, p.level_ms + normal(p.level_sd_ms));
  wander_ms_ = normal(p.ar_sd_ms);
}

void DelayProcess::leave() {
  if (state_ == RadioState::kStable) return enter(RadioState::kEdge);
  const bool bad = state_ == RadioState::kEdge && uniform() < params_.bad_after_edge;
  enter(bad ? RadioState::kBad : RadioState::kStable);
}

double DelayProcess::normal(double sd) { return sd > 0 ? sd * unit_normal_(rng_) : 0.0; }

double DelayProcess::uniform() { return std::uniform_real_distribution<double>{0.0, 1.0}(rng_); }

}  // namespace interneuron::emu
