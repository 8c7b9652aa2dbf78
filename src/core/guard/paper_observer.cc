#include "core/guard/observers.h"

#include <algorithm>

namespace interneuron::guard {
namespace {

constexpr std::int64_t kXOne = 1000;
// Without a reference a smaller variant is held for a quarter of the deadline at most
// (docs/paper.md, "Holds").
constexpr int kBlindHoldDivisor = 4;

}  // namespace

std::optional<Duration> PaperObserver::stage_deadline(TimePoint now, const StageEnd& end,
                                                      const std::optional<ClockView>& clock) {
  const std::optional<Duration> base = times_.base(now, end.stage);
  if (!base || (!clock && !at_origin_)) return std::nullopt;
  const std::int64_t alpha = at_origin_ ? 0 : clock->alpha;
  const Duration least = at_origin_ ? Duration{} : clock->rtt_min / 2;
  const Duration b = std::clamp(Duration{wrapping_sub(base->count(), alpha)},
                                std::min(least, end.deadline), end.deadline);
  return Duration{wrapping_add(base->count(), b.count() * end.x_permille / kXOne)};
}

void PaperObserver::observe(const StageEnd& end, Duration theta) {
  if (!ablation_.learn_below_zero && end.x_permille < 0) return;
  times_.observe(end.round, end.stage, theta);
}

Verdict PaperObserver::end_stage(TimePoint now, const StageEnd& end,
                                 const std::optional<ClockView>& clock) {
  const Duration theta = elapsed_across(end.t0, now);
  const std::optional<Duration> dn = stage_deadline(now, end, clock);
  observe(end, theta);
  Verdict verdict;
  if (dn) {
    const Duration overrun{wrapping_sub(theta.count(), dn->count())};
    if (overrun.count() > 0) verdict = {.late = true, .overrun = overrun};
  } else if (end.x_permille < 0) {
    // Otherwise a pipeline that is never on time, and so has no reference, would never be
    // sacrificed.
    verdict = {.late = true, .overrun = kFullSeverity};
  }
  return verdict;
}

PaperObserver::Hold PaperObserver::hold(TimePoint now, const StageEnd& end,
                                        const std::optional<ClockView>& clock, bool last_stage) {
  std::optional<Duration> dn = stage_deadline(now, end, clock);
  if (!dn) return {now + end.deadline / kBlindHoldDivisor, false, false};
  if (last_stage && at_origin_) dn = std::min(*dn, end.deadline);
  const TimePoint until = when_elapsed(end.t0, *dn);
  const TimePoint bound = now + end.deadline;
  return until <= bound ? Hold{until, true, true} : Hold{bound, false, true};
}

Verdict PaperObserver::end_stage_held(const StageEnd& end, const Hold& hold) {
  observe(end, elapsed_across(end.t0, hold.until));
  Verdict verdict;
  verdict.released_at_deadline = hold.is_stage_deadline;
  if (!hold.has_reference && end.x_permille < 0) {
    verdict.late = true;
    verdict.overrun = kFullSeverity;
  }
  return verdict;
}

LevelChoice PaperObserver::begin_computation(TimePoint now, const StageEnd& end,
                                             const std::optional<ClockView>& clock,
                                             std::span<const LevelProfile> levels, std::size_t top,
                                             const Verdict& verdict) {
  Verdict latest = verdict;
  const std::optional<Duration> dn =
      ablation_.judge_at_start ? stage_deadline(now, end, clock) : std::nullopt;
  if (dn) {
    const Duration overrun{wrapping_sub(elapsed_across(end.t0, now).count(), dn->count())};
    if (overrun > kTurn) latest = {.late = true, .overrun = overrun};
  }
  return {sacrificed_level(levels, top, latest), std::nullopt};
}

}  // namespace interneuron::guard
