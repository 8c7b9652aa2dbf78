#include "core/dispatch/round.h"

#include <algorithm>

#include "core/wire/header.h"

namespace interneuron::dispatch {
namespace {

std::optional<std::uint8_t> used(std::uint8_t told) {
  return told == wire::kNoneUsed ? std::nullopt : std::optional(told);
}

}  // namespace

Round round_of(const wire::RoundHeader& h) {
  const auto weight = [&h](std::size_t i) { return static_cast<double>(h.needs[i]) / 255.0; };
  Round r{.ref = h.round,
          .stage = h.stage,
          .stages = h.stages,
          .communication = h.communication,
          .variant = h.variant,
          .best_planned = h.best_planned,
          .degraded = h.degraded,
          .qos = {h.deadline(),
                  std::chrono::microseconds(h.period_us),
                  h.message_class,
                  {weight(0), weight(1), weight(2), weight(3)}},
          .policy = h.policy,
          .t0 = h.t0,
          .alpha_sum = h.alpha_sum,
          .x_permille = h.x_permille,
          .terms = {h.guard, h.miss_price / 1000.0, h.local_quality / 255.0},
          .indicator = h.indicator,
          .level_used = used(h.level_used),
          .variant_used = used(h.variant_used),
          .excess = h.from_steps(h.excess),
          .computed = h.from_steps(h.computed)};
  for (std::size_t i = 0; i < h.e2e.size(); ++i) {
    if (h.e2e[i] == 0) continue;
    r.recent_e2e[i] = h.e2e[i] == wire::kE2eNever ? guard::kNever : h.from_steps(h.e2e[i]);
  }
  return r;
}

wire::RoundHeader header_of(const Round& r) {
  const Nature& needs = r.qos.needs;
  wire::RoundHeader h{
      .round = r.ref,
      .stage = r.stage,
      .stages = r.stages,
      .communication = r.communication,
      .variant = r.variant,
      .best_planned = r.best_planned,
      .degraded = r.degraded,
      .message_class = r.qos.message_class,
      .needs = {wire::share_of_255(needs.delay), wire::share_of_255(needs.bandwidth),
                wire::share_of_255(needs.reliability), wire::share_of_255(needs.security)},
      .policy = r.policy,
      .t0 = r.t0,
      .alpha_sum = r.alpha_sum,
      .x_permille = r.x_permille,
      .deadline_us = wire::to_us(r.qos.deadline),
      .period_us = wire::to_us(r.qos.period),
      .indicator = r.indicator,
      .guard = r.terms.kind,
      .level_used = r.level_used.value_or(wire::kNoneUsed),
      .variant_used = r.variant_used.value_or(wire::kNoneUsed),
      .local_quality = wire::share_of_255(r.terms.local_quality),
      .miss_price = static_cast<std::uint16_t>(r.terms.miss_price * 1000.0 + 0.5)};
  h.excess = static_cast<std::int16_t>(h.to_steps(r.excess, INT16_MIN, INT16_MAX));
  h.computed = static_cast<std::uint16_t>(h.to_steps(r.computed, 0, UINT16_MAX));
  for (std::size_t i = 0; i < h.e2e.size(); ++i) {
    const guard::E2e& e2e = r.recent_e2e[i];
    if (!e2e) continue;
    h.e2e[i] = *e2e == guard::kNever
                   ? wire::kE2eNever
                   : static_cast<std::uint16_t>(h.to_steps(*e2e, 1, wire::kE2eNever));
  }
  return h;
}

guard::StageEnd Round::stage_end(std::size_t stage_number) const {
  return {.round = ref.round,
          .stage = stage_number,
          .t0 = t0,
          .x_permille = x_permille,
          .deadline = qos.deadline,
          .variant = variant,
          .best_planned = best_planned,
          .degraded = degraded,
          .is_computation = !is_communication(stage_number),
          .terms = terms};
}

guard::Spent Round::spent() const {
  if (!variant_used) return {level_used, {}, {}, {}};
  return {level_used, variant_used, level_used ? std::optional(excess) : std::nullopt, computed};
}

void Round::note_level(const guard::LevelChoice& choice) {
  level_used = static_cast<std::uint8_t>(std::min<std::size_t>(choice.level, 254));
  excess = choice.excess.value_or(Duration::zero());
}

void Round::note_computed(Duration took) {
  variant_used = variant;
  computed += took;
}

}  // namespace interneuron::dispatch
