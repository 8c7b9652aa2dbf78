#include "guard/origin.h"

#include <algorithm>
#include <stdexcept>

namespace interneuron::guard {
namespace {

void check(const PipelineConfig& c) {
  if (c.stages.empty() || c.stages.size() > kMaxStages) {
    throw std::invalid_argument("pipeline " + std::to_string(c.id.value) + ": " +
                                std::to_string(c.stages.size()) + " stages; give 1 to " +
                                std::to_string(kMaxStages));
  }
  if (c.deadline <= Duration::zero() || c.deadline > std::chrono::hours(1)) {
    throw std::invalid_argument("pipeline " + std::to_string(c.id.value) +
                                ": the deadline must be more than 0 and at most one hour");
  }
  if (c.period <= Duration::zero() || c.period > std::chrono::hours(1)) {
    throw std::invalid_argument("pipeline " + std::to_string(c.id.value) +
                                ": the period must be more than 0 and at most one hour");
  }
}

}  // namespace

Origin::Origin(PipelineConfig config, SessionId self)
    : config_(std::move(config)),
      self_(self),
      x_({config_.beta_permille, config_.use_x, config_.use_handler}) {
  check(config_);
}

Origin::Begun Origin::begin(TimePoint now) {
  const RoundId round{next_round_++};
  Begun begun{{self_, config_.id, round},
              now,
              x_.begin(observer_.base(now, config_.stages.size()), config_.deadline)};
  states_[round.value % states_.size()] = RoundState::kUnknown;
  open_.push_back({begun, std::nullopt, false});
  return begun;
}

Indicator Origin::indicator(RoundId round) const {
  Indicator out{};
  for (std::uint32_t i = 0; i < out.size() && i < round.value; ++i) {
    out[i] = states_[(round.value - 1 - i) % states_.size()];
  }
  return out;
}

Origin::Open* Origin::find(RoundId round) {
  const auto it = std::ranges::find(open_, round, [](const Open& o) { return o.begun.ref.round; });
  return it == open_.end() ? nullptr : &*it;
}

const Origin::Begun* Origin::open(RoundId round) const {
  const auto it = std::ranges::find(open_, round, [](const Open& o) { return o.begun.ref.round; });
  return it == open_.end() ? nullptr : &it->begun;
}

std::optional<RoundDone> Origin::remote_result(TimePoint now, RoundId round, Bytes result,
                                               bool degraded) {
  const Open* open = find(round);
  if (open == nullptr || now > open->begun.t0 + config_.deadline) return std::nullopt;
  const std::size_t last_stage = config_.stages.size();
  observer_.end_stage(
      now,
      {round, last_stage, as_wire(open->begun.t0), open->begun.sent.x_permille, config_.deadline},
      std::nullopt);
  keep_last(round, result);
  RoundDone done = decide(now, round, Outcome::kRemote);
  done.result = std::move(result);
  done.age_rounds = 0;
  done.degraded_final = degraded;
  return done;
}

void Origin::local_result(RoundId round, Bytes result) {
  Open* open = find(round);
  if (open == nullptr) return;
  keep_last(round, result);
  open->local = std::move(result);
}

void Origin::stay_local(RoundId round) {
  if (Open* open = find(round)) open->stays_local = true;
}

std::vector<RoundDone> Origin::expire(TimePoint now) {
  std::vector<RoundDone> out;
  while (!open_.empty() && open_.front().begun.t0 + config_.deadline <= now) {
    const RoundId round = open_.front().begun.ref.round;
    std::optional<Bytes> local = std::move(open_.front().local);
    RoundDone done = decide(now, round, Outcome::kLocal);
    if (local) {
      done.result = std::move(*local);
      done.age_rounds = 0;
    } else if (last_) {
      done.result = last_->result;
      done.age_rounds = round.value - last_->round.value;
    }
    out.push_back(std::move(done));
  }
  return out;
}

// The only place where a round gets its outcome: it is taken out of open_, so that there cannot be
// a second one.
RoundDone Origin::decide(TimePoint now, RoundId round, Outcome outcome) {
  const auto it = std::ranges::find(open_, round, [](const Open& o) { return o.begun.ref.round; });
  const Begun begun = it->begun;
  const bool on_time = outcome == Outcome::kRemote;
  const bool missed = !on_time && !it->stays_local;
  open_.erase(it);
  const RoundState state = on_time  ? RoundState::kOnTime
                           : missed ? RoundState::kMissed
                                    : RoundState::kUnknown;
  states_[round.value % states_.size()] = state;
  observer_.settle(now, round, state);
  if (on_time) {
    x_.on_time(begun.sent.recovering);
  } else if (missed) {
    x_.missed();
  }
  RoundDone done;
  done.round = begun.ref;
  done.outcome = outcome;
  done.t0 = begun.t0;
  done.e2e = now - begun.t0;
  done.recovering = begun.sent.recovering;
  done.x_permille = begun.sent.x_permille;
  return done;
}

void Origin::keep_last(RoundId round, const Bytes& result) {
  if (last_ && static_cast<std::int32_t>(last_->round.value - round.value) > 0) return;
  last_ = Last{round, result};
}

std::optional<TimePoint> Origin::next_timeout() const {
  if (open_.empty()) return std::nullopt;
  return open_.front().begun.t0 + config_.deadline;
}

}  // namespace interneuron::guard
