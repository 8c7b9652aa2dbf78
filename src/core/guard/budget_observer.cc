#include "core/guard/observers.h"

#include <algorithm>
#include <utility>

namespace interneuron::guard {
namespace {

// Without a way to weigh it, a hold lasts a quarter of the deadline at most, as in guard kPaper
// (docs/paper.md, "Holds").
constexpr int kBlindHold = 4;
// A better variant is waited for a little beyond the time at which one came once, by this fraction
// of the deadline: 1 ms of 130 ms.
constexpr int kMargin = 128;
// A hold ends when so many eighths of the better ones have usually come, if this one does not.
constexpr std::size_t kHolds[] = {kMedian, 7};

Duration difference(Duration a, Duration b) {
  return Duration{bounded(wrapping_sub(a.count(), b.count()))};
}

// How much time is left until D_N when the rest of the round takes as long as the links say now,
// and its base beyond that.
Duration left_of(const StageEnd& end, Duration theta, Duration base, Duration ahead) {
  return difference(end.deadline, Duration{wrapping_add(theta.count(), base.count())}) - ahead;
}

}  // namespace

BudgetObserver::Computation& BudgetObserver::after(std::size_t stage) {
  auto& slot = after_[stage];
  if (!slot) slot = std::make_unique<Computation>();
  return *slot;
}

std::optional<Duration> BudgetObserver::excess(const Computation& c, TimePoint now,
                                               const StageEnd& end, Duration theta) {
  const auto reference = c.starts.median(now, key_of(end.variant, end.best_planned));
  return reference ? std::optional(difference(theta, Duration{*reference})) : std::nullopt;
}

BudgetObserver::Computation* BudgetObserver::before(const StageEnd& end) {
  for (std::size_t stage = end.stage; stage-- > 0;) {
    const auto& c = after_[stage];
    if (c && c->rounds.find(end.round) != nullptr) return c.get();
  }
  return nullptr;
}

void BudgetObserver::settle(TimePoint now, RoundId round, RoundState state, E2e e2e) {
  for (const auto& c : after_) {
    Entry* entry = c ? c->rounds.find(round) : nullptr;
    if (entry == nullptr || !entry->ended || entry->known) continue;
    ResidualLaw::Sample sample{.round = round, .before = entry->before};
    const auto base = c->law.base(now, 0);
    if (e2e && *e2e != kNever) {
      entry->known = true;
      sample.computed = difference(entry->end, entry->start) - entry->expected;
      const Duration rest{wrapping_sub(e2e->count(), entry->end.count())};
      sample.rest = Duration{wrapping_sub(rest.count(), entry->ahead.count())};
    } else if (base && state == RoundState::kMissed) {
      sample.answered = false;
      const Duration clean{wrapping_add(entry->start.count(), base->count())};
      sample.rest = difference(entry->deadline, clean) - entry->expected - entry->ahead;
    } else {
      continue;
    }
    c->law.add(now, sample);
  }
}

void BudgetObserver::note_arrival(TimePoint now, const StageEnd& end) {
  if (end.is_computation || end.degraded || end.variant != end.best_planned) return;
  after(end.stage).better.add(now, end.variant, elapsed_across(end.t0, now).count());
}

StageGuard::Hold BudgetObserver::hold(TimePoint now, const StageEnd& end,
                                      const std::optional<ClockView>&, bool) {
  const Computation& c = after(end.stage);
  const Duration theta = elapsed_across(end.t0, now);
  Hold out{now, false, true};
  // How much longer until so many eighths of the better ones have usually come.
  const auto wait = [&](std::size_t eighths) {
    const auto usual = c.better.quantile(now, end.best_planned, eighths);
    return usual ? difference(Duration{*usual}, theta) + end.deadline / kMargin : Duration::zero();
  };
  const auto base = c.law.base(now, 0);
  if (!base || c.levels.empty()) {
    if (wait(kMedian) <= end.deadline / kBlindHold) out.until = now + wait(kMedian);
    return out;
  }
  const ResidualLaw::Near law = c.law.near(excess(c, now, end, theta), end.deadline / kAlike);
  const Duration left = left_of(end, theta, *base, c.ahead);
  const auto value = [&](std::uint8_t variant, Duration at) {
    return best_level(c.levels, variant, law, c.speed, now, at, end.terms).second;
  };
  double most = value(end.variant, left);
  for (const std::size_t eighths : kHolds) {
    const Duration then = left - wait(eighths);
    if (then >= left) continue;
    const double came = static_cast<double>(eighths) / 8;
    const double held =
        came * value(end.best_planned, then) + (1 - came) * value(end.variant, then);
    if (held > most) out.until = now + wait(eighths);
    most = std::max(most, held);
  }
  return out;
}

Verdict BudgetObserver::end_stage(TimePoint now, const StageEnd& end,
                                  const std::optional<ClockView>&) {
  Computation* c = end.is_computation ? before(end) : nullptr;
  if (c == nullptr) return {};
  Entry& entry = *c->rounds.find(end.round);
  const bool first = !std::exchange(entry.ended, true);
  entry.end = elapsed_across(end.t0, now);
  if (first) c->speed.add(now, entry.level, entry.median, difference(entry.end, entry.start));
  return {};
}

LevelChoice BudgetObserver::begin_computation(TimePoint now, const StageEnd& end,
                                              const std::optional<ClockView>&,
                                              std::span<const LevelProfile> levels, std::size_t top,
                                              const Verdict&) {
  Computation& c = after(end.stage);
  if (!std::ranges::equal(c.levels, levels)) c.levels.assign(levels.begin(), levels.end());
  c.ahead = end.ahead;
  c.law.set_scale(end.deadline / kTail);
  const Duration theta = elapsed_across(end.t0, now);
  LevelChoice choice{.level = std::min(c.last_level.value_or(top), levels.size() - 1),
                     .excess = excess(c, now, end, theta)};
  c.starts.add(now, key_of(end.variant, end.best_planned), theta.count());
  if (const auto base = c.law.base(now, 0)) {
    const ResidualLaw::Near law = c.law.near(choice.excess, end.deadline / kAlike);
    const Duration left = left_of(end, theta, *base, end.ahead);
    choice.level = best_level(levels, end.variant, law, c.speed, now, left, end.terms).first;
    c.last_level = choice.level;
  }
  if (Entry* entry = c.rounds.enter(end.round)) {
    const Duration median = levels[choice.level].median;
    *entry = {.level = choice.level,
              .start = theta,
              .before = choice.excess.value_or(Duration::zero()),
              .median = median,
              .expected = c.speed.expected(now, choice.level, median),
              .deadline = end.deadline,
              .ahead = end.ahead};
  }
  return choice;
}

void BudgetObserver::reset() {
  for (const auto& c : after_) {
    if (!c) continue;
    c->law.drop_bases();
    c->starts.clear();
    c->rounds.clear();
    c->better.clear();
  }
}

}  // namespace interneuron::guard
