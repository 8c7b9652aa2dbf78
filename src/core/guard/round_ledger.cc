#include "core/guard/round_ledger.h"

#include <algorithm>
#include <stdexcept>

#include "core/guard/choice.h"

namespace interneuron::guard {
namespace {

void check(const PipelineConfig& c) {
  if (c.stages.empty() || c.stages.size() > kMaxStages) {
    throw std::invalid_argument("pipeline " + std::to_string(c.id.value) + ": " +
                                std::to_string(c.stages.size()) + " stages; give 1 to " +
                                std::to_string(kMaxStages));
  }
  if (c.stages.size() == 1 && c.stages.front() == StageKind::kCommunication) {
    throw std::invalid_argument("pipeline " + std::to_string(c.id.value) +
                                ": a lone communication never ends at its origin, so that no round "
                                "could be answered; send() sends a message one way");
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

bool within(double value, double low, double high) { return value >= low && value <= high; }

void check_budget(const PipelineConfig& c) {
  const std::string pipeline = "pipeline " + std::to_string(c.id.value);
  if (!within(c.budget.miss_price, 0, 65)) {
    throw std::invalid_argument(pipeline + ": the budget needs a miss price of 0 to 65");
  }
  for (const LevelProfile& level : c.levels) {
    if (level.median <= Duration::zero() || level.p95 < level.median) {
      throw std::invalid_argument(pipeline +
                                  ": a level needs a median run time > 0 and a p95 >= the median");
    }
  }
  const auto is_share = [](double q) { return within(q, 0, 1); };
  if (!is_share(c.fallback.local) || !std::ranges::all_of(c.fallback.stale_share, is_share)) {
    throw std::invalid_argument(pipeline + ": fallback qualities and shares are 0 to 1");
  }
}

}  // namespace

RoundLedger::RoundLedger(PipelineConfig config, SessionId self, const Ablation& ablation)
    : config_(std::move(config)), self_(self) {
  check(config_);
  check_budget(config_);
  guard_ = make_round_guard(config_, ablation);
  observer_ = make_stage_guard(config_.guard, true, ablation);
}

RoundLedger::Begun RoundLedger::begin(TimePoint now) {
  const RoundId round{next_round_++};
  Begun begun{{self_, config_.id, round},
              now,
              guard_->begin(observer_->base(now, config_.stages.size()), config_.deadline)};
  past_.enter(round)->t0 = now;
  open_.push_back({begun, std::nullopt, false, false});
  return begun;
}

Indicator RoundLedger::indicator(RoundId round) const {
  Indicator out{};
  for (std::uint32_t i = 0; i < out.size() && i < round.value; ++i) {
    if (const Past* past = past_.find(RoundId{round.value - 1 - i})) out[i] = past->state;
  }
  return out;
}

RecentE2e RoundLedger::recent_e2e(RoundId round) const {
  RecentE2e out{};
  for (std::uint32_t i = 0; i < out.size() && i < round.value; ++i) {
    if (const Past* past = past_.find(RoundId{round.value - 1 - i})) out[i] = past->e2e;
  }
  return out;
}

std::size_t RoundLedger::choose_mode(TimePoint now, RoundId round,
                                     std::span<const Forecast> modes) {
  Open* open = find(round);
  if (open == nullptr) return 0;
  const std::size_t mode = guard_->choose_mode(now, round, now - open->begun.t0, modes);
  open->begun.sent.degraded = mode + 1 == modes.size();
  return mode;
}

RoundLedger::Open* RoundLedger::find(RoundId round) {
  const auto it = std::ranges::find(open_, round, [](const Open& o) { return o.begun.ref.round; });
  return it == open_.end() ? nullptr : &*it;
}

const RoundLedger::Begun* RoundLedger::open(RoundId round) const {
  const auto it = std::ranges::find(open_, round, [](const Open& o) { return o.begun.ref.round; });
  return it == open_.end() ? nullptr : &it->begun;
}

std::optional<RoundDone> RoundLedger::remote_result(TimePoint now, RoundId round, Bytes result,
                                                    bool degraded, const Spent& spent) {
  const Open* open = find(round);
  if (open == nullptr || now > open->begun.t0 + config_.deadline) {
    learn_late(now, round, std::move(result), spent);
    return std::nullopt;
  }
  StageEnd end{.round = round,
               .stage = config_.stages.size(),
               .t0 = as_wire(open->begun.t0),
               .x_permille = open->begun.sent.x_permille,
               .deadline = config_.deadline};
  observer_->end_stage(now, end, std::nullopt);
  guard_->result(now, round, now - open->begun.t0, spent);
  keep_last(round, result);
  keep_remote(round, result, spent);
  RoundDone done = decide(now, round, Outcome::kRemote);
  done.result = std::move(result);
  done.age_rounds = 0;
  done.degraded_final = degraded;
  return done;
}

void RoundLedger::learn_late(TimePoint now, RoundId round, Bytes result, const Spent& spent) {
  Past* past = past_.find(round);
  if (past == nullptr || past->state == RoundState::kOnTime) return;
  const Duration e2e = now - past->t0;
  // Further copies come later still.
  if (past->e2e && *past->e2e != kNever) return;
  past->e2e = e2e;
  guard_->result(now, round, e2e, spent);
  keep_remote(round, result, spent);
}

std::optional<RoundDone> RoundLedger::local_result(TimePoint now, RoundId round, Bytes result) {
  Open* open = find(round);
  if (open == nullptr) return std::nullopt;
  keep_last(round, result);
  open->local = std::move(result);
  if (!open->stays_local && !open->given_up) return std::nullopt;
  return decide_locally(now, *open);
}

std::optional<RoundDone> RoundLedger::stay_local(TimePoint now, RoundId round) {
  Open* open = find(round);
  if (open == nullptr) return std::nullopt;
  open->stays_local = true;
  if (!open->local) return std::nullopt;
  return decide_locally(now, *open);
}

std::optional<RoundDone> RoundLedger::give_up(TimePoint now, RoundId round) {
  Open* open = find(round);
  if (open == nullptr) return std::nullopt;
  open->given_up = true;
  if (!open->local) return std::nullopt;
  return decide_locally(now, *open);
}

std::vector<RoundDone> RoundLedger::expire(TimePoint now) {
  std::vector<RoundDone> out;
  while (!open_.empty() && open_.front().begun.t0 + config_.deadline <= now) {
    out.push_back(decide_locally(now, open_.front()));
  }
  return out;
}

RoundDone RoundLedger::decide_locally(TimePoint now, Open& open) {
  std::optional<Bytes> local = std::move(open.local);
  RoundDone done = decide(now, open.begun.ref.round, Outcome::kLocal);
  answer(done, std::move(local));
  return done;
}

// Empty, this round's own or an older result.
void RoundLedger::answer(RoundDone& done, std::optional<Bytes> local) {
  const auto age = [&done](const Last& last) { return done.round.round.value - last.round.value; };
  const std::vector<double>& share = config_.fallback.stale_share;
  if (last_remote_ && age(*last_remote_) - 1U < share.size() &&
      last_remote_->quality * share[age(*last_remote_) - 1] >
          (local ? config_.fallback.local : 0.0)) {
    done.result = last_remote_->result;
    done.age_rounds = age(*last_remote_);
    done.stale_remote = true;
  } else if (local) {
    done.result = std::move(*local);
    done.age_rounds = 0;
  } else if (last_) {
    done.result = last_->result;
    done.age_rounds = age(*last_);
  }
}

// The only place where a round gets its outcome: it is taken out of open_, so that there cannot be
// a second one.
RoundDone RoundLedger::decide(TimePoint now, RoundId round, Outcome outcome) {
  const auto it = std::ranges::find(open_, round, [](const Open& o) { return o.begun.ref.round; });
  const Begun begun = it->begun;
  const bool on_time = outcome == Outcome::kRemote;
  const bool missed = !on_time && !it->stays_local;
  open_.erase(it);
  const RoundState state = on_time  ? RoundState::kOnTime
                           : missed ? RoundState::kMissed
                                    : RoundState::kUnknown;
  observer_->settle(now, round, state, remember(now, begun, state));
  if (on_time) {
    guard_->on_time(begun.sent);
  } else if (missed) {
    guard_->missed(now, round);
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

// Returns the round's end-to-end time. One that is so old that it is forgotten is not told of.
E2e RoundLedger::remember(TimePoint now, const Begun& begun, RoundState state) {
  Past* past = past_.find(begun.ref.round);
  if (past == nullptr) return std::nullopt;
  past->state = state;
  if (state == RoundState::kOnTime) {
    past->e2e = now - begun.t0;
  } else if (state == RoundState::kMissed && !past->e2e) {
    past->e2e = kNever;
  }
  return past->e2e;
}

void RoundLedger::keep_last(RoundId round, const Bytes& result) {
  if (last_ && static_cast<std::int32_t>(last_->round.value - round.value) > 0) return;
  last_ = Last{round, result};
}

void RoundLedger::keep_remote(RoundId round, const Bytes& result, const Spent& spent) {
  if (config_.fallback.stale_share.empty() || !spent.level ||
      *spent.level >= config_.levels.size()) {
    return;
  }
  if (last_remote_ && static_cast<std::int32_t>(last_remote_->round.value - round.value) > 0) {
    return;
  }
  last_remote_ =
      Last{round, result, quality_of(config_.levels, *spent.level, spent.variant.value_or(0))};
}

std::optional<TimePoint> RoundLedger::next_timeout() const {
  if (open_.empty()) return std::nullopt;
  return open_.front().begun.t0 + config_.deadline;
}

}  // namespace interneuron::guard
