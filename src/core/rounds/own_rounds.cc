#include "core/rounds/own_rounds.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>

#include "core/base/earliest.h"

namespace interneuron {
namespace {

std::array<std::uint8_t, 4> quantised(const Nature& needs) {
  const auto q = [](double w) {
    return static_cast<std::uint8_t>(std::clamp(w, 0.0, 1.0) * 255.0 + 0.5);
  };
  return {q(needs.delay), q(needs.bandwidth), q(needs.reliability), q(needs.security)};
}

std::uint32_t to_us(Duration d) {
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(d).count(), 1, UINT32_MAX));
}

void describe(wire::RoundHeader& h, const PipelineConfig& config) {
  h.stages = static_cast<std::uint8_t>(config.stages.size());
  h.communication = 0;
  for (std::size_t i = 0; i < config.stages.size(); ++i) {
    if (config.stages[i] == StageKind::kCommunication) {
      h.communication = static_cast<std::uint16_t>(h.communication | (1U << i));
    }
  }
  h.needs = quantised(config.needs);
  h.policy = wire::policy_id(config.policy);
  h.deadline_us = to_us(config.deadline);
  h.period_us = to_us(config.period);
  h.guard = config.guard;
  h.miss_price = static_cast<std::uint16_t>(config.budget.miss_price * 1000.0 + 0.5);
  h.local_quality = static_cast<std::uint8_t>(config.fallback.local * 255.0 + 0.5);
}

}  // namespace

OwnRounds::OwnRounds(SessionId self, const std::vector<PipelineConfig>& pipelines,
                     const Ablation& ablation)
    : self_(self) {
  for (const PipelineConfig& config : pipelines) {
    if (!pipelines_
             .try_emplace(config.id, Pipeline{guard::RoundLedger(config, self, ablation), 0, {}})
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
  wire::RoundHeader& h = context.header;
  describe(h, ledger.config());
  h.round = begun.ref;
  h.t0 = as_wire(now);
  h.x_permille = begun.sent.x_permille;
  h.indicator = ledger.indicator(begun.ref.round);
  const guard::RecentE2e recent = ledger.recent_e2e(begun.ref.round);
  for (std::size_t i = 0; i < recent.size(); ++i) {
    if (!recent[i]) continue;
    h.e2e[i] = *recent[i] == guard::kNever
                   ? wire::kE2eNever
                   : static_cast<std::uint16_t>(h.to_steps(*recent[i], 1, wire::kE2eNever));
  }
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

const OwnRounds::Round* OwnRounds::find_round(const RoundRef& round) const {
  const auto it = pipelines_.find(round.pipeline);
  return is_mine(round) && it != pipelines_.end() ? it->second.rounds.find(round.round) : nullptr;
}

void OwnRounds::note_sent(const RoundRef& round, PeerId to) {
  if (!is_mine(round) || was_sent_to(round, to).value_or(true)) return;
  pipelines_.at(round.pipeline).rounds.find(round.round)->sent_to.push_back(to);
}

std::optional<bool> OwnRounds::was_sent_to(const RoundRef& round, PeerId peer) const {
  const Round* found = find_round(round);
  if (found == nullptr) return std::nullopt;
  return std::ranges::find(found->sent_to, peer) != found->sent_to.end();
}

bool OwnRounds::restore(wire::RoundHeader& header) const {
  const Round* found = find_round(header.round);
  if (found == nullptr) return false;
  const PipelineConfig& config = pipelines_.at(header.round.pipeline).ledger.config();
  header.t0 = as_wire(found->t0);
  header.deadline_us = to_us(config.deadline);
  header.period_us = to_us(config.period);
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

}  // namespace interneuron
