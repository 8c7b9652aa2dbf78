#include "core/rounds/own_rounds.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>

#include "core/base/earliest.h"

namespace interneuron::rounds {
namespace {

// What all rounds of a pipeline have in common, as others read it.
dispatch::Round common_of(const PipelineConfig& config) {
  dispatch::Round r;
  r.stages = static_cast<std::uint8_t>(config.stages.size());
  r.communication = 0;
  for (std::size_t i = 0; i < config.stages.size(); ++i) {
    if (config.stages[i] == StageKind::kCommunication) {
      r.communication = static_cast<std::uint16_t>(r.communication | (1U << i));
    }
  }
  r.qos.needs = config.needs;
  r.qos.deadline = config.deadline;
  r.qos.period = config.period;
  r.policy = wire::policy_id(config.policy);
  r.terms = {config.guard, config.budget.miss_price, config.fallback.local};
  return dispatch::as_told(r);
}

}  // namespace

OwnRounds::OwnRounds(SessionId self, const std::vector<PipelineConfig>& pipelines,
                     const Ablation& ablation)
    : self_(self) {
  for (const PipelineConfig& config : pipelines) {
    guard::RoundLedger ledger(config, self, ablation);
    if (!pipelines_.try_emplace(config.id, Pipeline{std::move(ledger), common_of(config), 0, {}})
             .second) {
      throw std::invalid_argument("pipeline " + std::to_string(config.id.value) + ": given twice");
    }
  }
}

RoundContext OwnRounds::begin(TimePoint now, PipelineId pipeline) {
  const auto it = pipelines_.find(pipeline);
  if (it == pipelines_.end()) {
    throw std::invalid_argument("begin_round: no pipeline " + std::to_string(pipeline.value));
  }
  guard::RoundLedger& ledger = it->second.ledger;
  const guard::RoundLedger::Begun begun = ledger.begin(now);
  it->second.begun = begun.ref.round.value + 1;
  it->second.rounds.enter(begun.ref.round)->t0 = now;
  RoundContext context;
  context.round = it->second.common;
  context.round.ref = begun.ref;
  context.round.t0 = as_wire(now);
  context.round.x_permille = begun.sent.x_permille;
  context.round.indicator = ledger.indicator(begun.ref.round);
  context.round.recent_e2e = ledger.recent_e2e(begun.ref.round);
  context.round = dispatch::as_told(context.round);
  context.began = now;
  // The guard's decision on the first transmission takes the place of the verdict of a stage
  // before.
  context.verdict.late = begun.sent.degraded;
  return context;
}

bool OwnRounds::has_begun(const RoundRef& round) const {
  const auto it = pipelines_.find(round.pipeline);
  return is_mine(round) && it != pipelines_.end() && round.round.value < it->second.begun;
}

const OwnRounds::Begun* OwnRounds::find_begun(const RoundRef& round) const {
  const auto it = pipelines_.find(round.pipeline);
  return is_mine(round) && it != pipelines_.end() ? it->second.rounds.find(round.round) : nullptr;
}

void OwnRounds::note_sent(const RoundRef& round, PeerId to) {
  if (!is_mine(round) || was_sent_to(round, to).value_or(true)) return;
  pipelines_.at(round.pipeline).rounds.find(round.round)->sent_to.push_back(to);
}

std::optional<bool> OwnRounds::was_sent_to(const RoundRef& round, PeerId peer) const {
  const Begun* found = find_begun(round);
  if (found == nullptr) return std::nullopt;
  return std::ranges::find(found->sent_to, peer) != found->sent_to.end();
}

bool OwnRounds::restore(dispatch::Round& round) const {
  const Begun* found = find_begun(round.ref);
  if (found == nullptr) return false;
  const QoS& true_qos = pipelines_.at(round.ref.pipeline).common.qos;
  round.t0 = as_wire(found->t0);
  round.qos.deadline = true_qos.deadline;
  round.qos.period = true_qos.period;
  return true;
}

guard::RoundLedger* OwnRounds::find(const RoundRef& round) {
  const auto it = pipelines_.find(round.pipeline);
  return is_mine(round) && it != pipelines_.end() ? &it->second.ledger : nullptr;
}

std::vector<RoundDone> OwnRounds::expire(TimePoint now) {
  std::vector<RoundDone> all;
  for (auto& [id, pipeline] : pipelines_) {
    auto done = pipeline.ledger.expire(now);
    all.insert(all.end(), std::make_move_iterator(done.begin()),
               std::make_move_iterator(done.end()));
  }
  return all;
}

std::optional<TimePoint> OwnRounds::next_timeout() const {
  std::optional<TimePoint> next;
  for (const auto& [id, pipeline] : pipelines_) {
    next = earliest(next, pipeline.ledger.next_timeout());
  }
  return next;
}

}  // namespace interneuron::rounds
