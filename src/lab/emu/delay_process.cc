#include "lab/emu/delay_process.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "lab/emu/delay_trace.h"
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

// A group of coupled processes, which make their steps together.
class CommonFading {
 public:
  CommonFading(double c, std::uint64_t seed) : c_(c), stream_(seed) {}

  static void join(const std::shared_ptr<CommonFading>& group, DelayProcess& process);
  void remove(const DelayProcess& process);
  // Makes one step of every member.
  void make_step();

 private:
  double c_;
  RandomStream stream_;
  // nullptr for a process that has been destroyed.
  std::vector<DelayProcess*> members_;
  // Which members have entered EDGE in the present step.
  std::vector<bool> entered_;
};

DelayParams constant_delay(double rtt_ms, double loss) {
  DelayParams params;
  RadioStateParams only_state{.level_ms = rtt_ms};
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

void couple(std::span<const std::shared_ptr<DelayProcess>> processes, double c,
            std::uint64_t seed) {
  if (c <= 0 || processes.size() < 2) return;
  auto fading = std::make_shared<CommonFading>(c, seed);
  for (const auto& process : processes) CommonFading::join(fading, *process);
}

void CommonFading::join(const std::shared_ptr<CommonFading>& group, DelayProcess& process) {
  assert(process.made() == 1 && !process.fading_);
  process.fading_ = group;
  group->members_.push_back(&process);
}

void CommonFading::remove(const DelayProcess& process) {
  std::replace(members_.begin(), members_.end(), const_cast<DelayProcess*>(&process),
               static_cast<DelayProcess*>(nullptr));
}

void CommonFading::make_step() {
  entered_.assign(members_.size(), false);
  for (std::size_t i = 0; i < members_.size(); ++i) {
    entered_[i] = members_[i] != nullptr && members_[i]->end_episode();
  }
  for (std::size_t i = 0; i < members_.size(); ++i) {
    if (!entered_[i]) continue;
    for (DelayProcess* other : members_) {
      // Drawn for every other, whatever its state, so that one link's state does not shift the
      // draws of the rest.
      const bool triggered = stream_.chance(c_);
      if (other == nullptr || !triggered || other->params_.trace) continue;
      if (other->state_ == RadioState::kStable) other->enter(RadioState::kEdge);
    }
  }
  for (DelayProcess* member : members_) {
    if (member != nullptr) member->append_sample();
  }
}

}  // namespace interneuron::emu
