#include "core/guard/budget_observer.h"

#include <algorithm>

namespace interneuron::guard {
namespace {

// Without a way to weigh it, a hold lasts a quarter of the deadline at most, as in guard kPaper
// (docs/paper.md, "Holds").
constexpr int kBlindHold = 4;
// A better variant is waited for a little beyond the time at which one came once, by this fraction
// of the deadline: 1 ms of 130 ms.
constexpr int kMargin = 128;
// How many lengths of a hold are weighed against each other. Each costs two evaluations of the law.
constexpr std::size_t kCandidates = 4;

constexpr std::uint8_t key_of(const StageEnd& end) {
  return static_cast<std::uint8_t>((end.variant % kMaxVariants) +
                                   (end.degraded ? kMaxVariants : std::size_t{0}));
}

// Peers' bytes may make a difference of any size. One of more than an hour, in ns, means nothing.
constexpr std::int64_t kBound = 3'600'000'000'000;

Duration difference(Duration a, Duration b) {
  return Duration{std::clamp(wrapping_sub(a.count(), b.count()), -kBound, kBound)};
}

// How much time is left until D_N when the rest of the round takes as long as the links say now,
// and its base beyond that.
Duration left_of(const StageEnd& end, Duration theta, Duration base, Duration ahead) {
  return difference(end.deadline, Duration{wrapping_add(theta.count(), base.count())}) - ahead;
}

// Adds `w`, weighted by the probability `share` of its case.
void add(Worth& to, const Worth& w, double share) {
  to.on_time.least += w.on_time.least * share;
  to.on_time.most += w.on_time.most * share;
  to.on_time.hedged += w.on_time.hedged * share;
  to.value += w.value * share;
}

}  // namespace

BudgetObserver::Computation& BudgetObserver::after(std::size_t stage) {
  auto& slot = after_[stage];
  if (!slot) slot = std::make_unique<Computation>();
  return *slot;
}

BudgetObserver::Computation* BudgetObserver::before(const StageEnd& end) {
  for (std::size_t stage = end.stage; stage-- > 0;) {
    Computation* c = after_[stage].get();
    if (c == nullptr) continue;
    if (c->rounds.find(end.round) != nullptr) return c;
  }
  return nullptr;
}

void BudgetObserver::learn(TimePoint now, RoundId current, const Indicator& indicator,
                           const RecentE2e& e2e) {
  for (std::size_t i = indicator.size(); i-- > 0;) {
    if (current.value <= i || indicator[i] == RoundState::kUnknown) continue;
    settle(now, RoundId{current.value - 1 - static_cast<std::uint32_t>(i)}, indicator[i], e2e[i]);
  }
}

void BudgetObserver::settle(TimePoint now, RoundId round, RoundState state, E2e e2e) {
  for (const auto& c : after_) {
    if (c) settle(*c, now, round, state, e2e);
  }
}

void BudgetObserver::settle(Computation& c, TimePoint now, RoundId round, RoundState state,
                            E2e e2e) {
  Entry* entry = c.rounds.find(round);
  if (entry == nullptr || !entry->ended || entry->known) return;
  ResidualLaw::Sample sample;
  sample.round = round;
  sample.at = now;
  sample.before = entry->before;
  if (e2e && *e2e != kNever) {
    entry->known = true;
    sample.run = {entry->level, entry->median, difference(entry->end, entry->start)};
    sample.computed = sample.run.took - entry->expected;
    sample.rest = Duration{
        wrapping_sub(wrapping_sub(e2e->count(), entry->end.count()), entry->ahead.count())};
    c.law.add(now, sample);
    c.law.reconsider(c.speed);
  } else if (state == RoundState::kMissed && !entry->beyond) {
    const auto base = c.law.base(now, 0);
    if (!base) return;
    entry->beyond = true;
    sample.kind = ResidualLaw::Sample::Kind::kBeyond;
    const Duration rest{wrapping_add(entry->start.count(), base->count())};
    sample.rest =
        entry->before + difference(entry->deadline, rest) - entry->expected - entry->ahead;
    c.law.add(now, sample);
  }
}

void BudgetObserver::note_arrival(TimePoint now, const StageEnd& end) {
  if (end.is_computation || end.degraded) return;
  RoundRing<Better>& rounds = after(end.stage).better;
  Better* b = rounds.find(end.round);
  if (b == nullptr) {
    b = rounds.enter(end.round);
    if (b == nullptr) return;
    b->at = now;
  }
  if (end.variant == end.best_planned && !b->theta) b->theta = elapsed_across(end.t0, now);
}

BudgetObserver::Chances BudgetObserver::chances(const Computation& c, const ResidualLaw::Near& law,
                                                Duration left) {
  Chances out{};
  for (std::size_t level = 0; level < std::min(c.levels.size(), kMaxLevels); ++level) {
    out[level] = law.within(left - c.speed.expected(level, c.levels[level].median));
  }
  return out;
}

std::pair<std::size_t, Worth> BudgetObserver::best_level(const Computation& c,
                                                         const Chances& chances,
                                                         std::uint8_t variant, const Terms& terms) {
  Best<std::size_t> best(terms.target);
  for (std::size_t level = 0; level < std::min(c.levels.size(), kMaxLevels); ++level) {
    best.consider(level, worth(chances[level], quality_of(c.levels, level, variant), terms));
  }
  return best.get().value_or(std::pair<std::size_t, Worth>{});
}

StageGuard::Hold BudgetObserver::hold(TimePoint now, const StageEnd& end,
                                      const std::optional<ClockView>&, bool last_stage) {
  Computation& c = after(end.stage);
  const Duration theta = elapsed_across(end.t0, now);
  // In how long the better variant may still come, by the rounds in which it was not there either
  // after so long; one round more in which it never came is assumed.
  std::array<Duration, kRoundSlots> ahead;
  std::size_t coming = 0;
  std::size_t rounds = 1;
  c.better.for_each([&](RoundId round, const Better& b) {
    if (round == end.round || now - b.at > kRecent) return;
    if (!b.theta) {
      if (now - b.at > end.deadline) ++rounds;
    } else if (wrapping_sub(b.theta->count(), theta.count()) > 0) {
      ++rounds;
      ahead[coming++] = difference(*b.theta, theta);
    }
  });
  std::sort(ahead.begin(), ahead.begin() + static_cast<std::ptrdiff_t>(coming));
  Hold out{now, false, true};
  const Duration margin = end.deadline / kMargin;
  const auto base = c.law.base(now, 0);
  if (coming == 0) return out;
  if (last_stage || !base || c.levels.empty()) {
    const Duration wait = ahead[(coming - 1) * 9 / 10] + margin;
    if (wait <= end.deadline / kBlindHold) out.until = now + wait;
    if (last_stage && at_origin_) {
      out.until = std::min(out.until, when_elapsed(end.t0, end.deadline));
    }
    return out;
  }
  const std::optional<std::int64_t> start = c.starts.median(now, key_of(end));
  std::optional<Duration> before;
  if (start) before = difference(theta, Duration{*start});
  const ResidualLaw::Near law = c.law.near(before, end.deadline / kAlike);
  const Duration left = left_of(end, theta, *base, c.ahead);
  Best<Duration> best(end.terms.target);
  best.consider({}, best_level(c, chances(c, law, left), end.variant, end.terms).second);
  // Summed over the rounds in which the better variant had come by then.
  Worth came;
  std::size_t counted = 0;
  for (std::size_t i = 1; i <= kCandidates; ++i) {
    const std::size_t by = (coming * i + kCandidates - 1) / kCandidates;
    if (by <= counted) continue;
    const Duration wait = ahead[by - 1] + margin;
    if (wait > end.deadline) break;
    const Chances then = chances(c, law, left - wait);
    const Worth with = best_level(c, then, end.best_planned, end.terms).second;
    const Worth without = best_level(c, then, end.variant, end.terms).second;
    const auto more = static_cast<double>(by - counted);
    add(came, with, more);
    counted = by;
    const auto rest = static_cast<double>(rounds - by);
    const auto all = static_cast<double>(rounds);
    Worth w;
    add(w, came, 1 / all);
    add(w, without, rest / all);
    best.consider(wait, w);
  }
  out.until = now + best.get()->first;
  return out;
}

Verdict BudgetObserver::end_stage(TimePoint now, const StageEnd& end,
                                  const std::optional<ClockView>&) {
  return finish(now, end, elapsed_across(end.t0, now));
}

Verdict BudgetObserver::end_stage_held(const StageEnd& end, const Hold& hold) {
  return finish(hold.until, end, elapsed_across(end.t0, hold.until));
}

Verdict BudgetObserver::finish(TimePoint now, const StageEnd& end, Duration theta) {
  Verdict verdict;
  if (!end.is_computation) return verdict;
  Computation* c = before(end);
  if (c == nullptr) return verdict;
  Entry& entry = *c->rounds.find(end.round);
  const bool first = !entry.ended;
  entry.end = theta;
  entry.ended = true;
  if (first) c->speed.add(now, entry.level, entry.median, difference(entry.end, entry.start));
  const auto base = c->law.base(now, 0);
  if (!base) return verdict;
  const Duration left = left_of(end, theta, *base, entry.ahead);
  if (c->law.near(std::nullopt, {}).rest_within(left) < end.terms.target) {
    verdict = {.late = true, .overrun = std::max(Duration{1}, -left)};
  }
  return verdict;
}

void BudgetObserver::remember(Computation& c, std::span<const LevelProfile> levels) {
  const bool same =
      std::ranges::equal(c.levels, levels, [](const LevelProfile& a, const LevelProfile& b) {
        return a.median == b.median && a.quality == b.quality;
      });
  if (!same) c.levels.assign(levels.begin(), levels.end());
}

LevelChoice BudgetObserver::begin_computation(TimePoint now, const StageEnd& end,
                                              const std::optional<ClockView>&,
                                              std::span<const LevelProfile> levels, std::size_t top,
                                              const Verdict&) {
  Computation& c = after(end.stage);
  remember(c, levels);
  c.ahead = end.ahead;
  c.law.set_scale(end.deadline / kTail);
  const Duration theta = elapsed_across(end.t0, now);
  const auto reference = c.starts.median(now, key_of(end));
  c.starts.add(now, key_of(end), theta.count());
  LevelChoice choice;
  std::optional<Duration> before;
  if (reference) before = difference(theta, Duration{*reference});
  choice.excess = before;
  choice.level = c.has_decided ? std::min(c.last_level, levels.size() - 1) : top;
  if (const auto base = c.law.base(now, 0)) {
    const ResidualLaw::Near law = c.law.near(before, end.deadline / kAlike);
    const Chances now_begun = chances(c, law, left_of(end, theta, *base, end.ahead));
    choice.level = best_level(c, now_begun, end.variant, end.terms).first;
    c.has_decided = true;
    c.last_level = choice.level;
  }
  Entry* entry = c.rounds.enter(end.round);
  if (entry == nullptr) return choice;
  *entry = Entry{};
  entry->level = choice.level;
  entry->start = theta;
  entry->before = before.value_or(Duration::zero());
  entry->median = levels[choice.level].median;
  entry->expected = c.speed.expected(choice.level, entry->median);
  entry->deadline = end.deadline;
  entry->ahead = end.ahead;
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
