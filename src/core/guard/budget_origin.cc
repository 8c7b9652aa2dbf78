#include "core/guard/budget_origin.h"

#include <algorithm>

namespace interneuron::guard {
namespace {

// What was learnt of a mode that is not tried any more has half its weight after so long: the
// quality of a cell changes in tens of seconds.
constexpr Duration kFade = std::chrono::seconds(30);
// The quality of a smaller variant relative to the best one, where the levels do not say: the paper
// measured a loss of 4 to 8 % (docs/paper.md, "Adjusting quality and size").
constexpr double kSmallerQuality = 0.95;

constexpr std::uint8_t key_of(bool degraded, std::size_t variant) {
  return static_cast<std::uint8_t>(variant + (degraded ? kMaxVariants : std::size_t{0}));
}

}  // namespace

BudgetOrigin::BudgetOrigin(const PipelineConfig& config)
    : deadline_(config.deadline),
      options_(config.budget),
      terms_{config.guard, config.budget.target, config.budget.miss_price, config.fallback.local},
      configured_(config.levels) {
  law_.set_scale(deadline_ / kTail);
  learnt_.push_back({Duration{1}, Duration{1}, {1.0, kSmallerQuality}});
}

std::span<const LevelProfile> BudgetOrigin::levels() const {
  return configured_.empty() ? learnt_ : configured_;
}

Duration BudgetOrigin::bias(TimePoint now, std::uint8_t key, bool as_forecast) const {
  // What forecasts of all modes err by, as the mode that was tried last tells.
  std::uint8_t last = key;
  for (std::uint8_t k = 0; k < ResidualLaw::kKeys; ++k) {
    const auto at = law_.newest(k);
    const auto best = law_.newest(last);
    if (at && (!best || *at > *best)) last = k;
  }
  const Duration common = law_.base(now, last).value_or(Duration::zero());
  const auto own = law_.base(now, key);
  if (!own || as_forecast) return common;
  const auto age = static_cast<double>((now - *law_.newest(key) - kRecent).count());
  if (age <= 0) return *own;
  const double share =
      static_cast<double>(kFade.count()) / (static_cast<double>(kFade.count()) + age);
  return common +
         Duration{static_cast<std::int64_t>(static_cast<double>((*own - common).count()) * share)};
}

void BudgetOrigin::learn(TimePoint now, const ResidualLaw::Sample& sample) {
  law_.add(now, sample);
  law_.reconsider(speed_);
  const std::int64_t width = std::max<std::int64_t>(1, deadline_.count() / kAlike);
  rounds_in_class_ = {};
  for (std::size_t i = 0; i < law_.size(); ++i) {
    const ResidualLaw::Pair p = law_.pair(i);
    const std::int64_t before = p.beyond ? 0 : p.before;
    const auto which =
        static_cast<std::size_t>(std::clamp<std::int64_t>(before / width, 0, kClasses - 1));
    losses_[i] = {p.beyond ? p.after : p.before + p.after, which, p.beyond};
    rounds_in_class_[which] += 1;
  }
}

// Within each class of rounds the level is taken that the observing node would take.
Worth BudgetOrigin::worth_at(Duration clean, std::uint8_t variant) const {
  const auto ladder = levels();
  const std::size_t count = std::min(ladder.size(), kMaxLevels);
  std::array<Duration, kMaxLevels> slack{};
  std::array<std::array<double, kClasses>, kMaxLevels> hits{};
  for (std::size_t l = 0; l < count; ++l) {
    slack[l] = deadline_ - clean - speed_.expected(l, ladder[l].median);
    for (std::size_t i = 0; i < law_.size(); ++i) {
      const Loss& loss = losses_[i];
      if (loss.beyond) {
        hits[l][loss.which] += 1.0 - law_.tail(slack[l] - Duration{loss.total});
      } else {
        hits[l][loss.which] += loss.total <= slack[l].count() ? 1.0 : 0.0;
      }
    }
  }
  const bool blind = law_.size() == 0;
  // How many rounds of the law would have been on time.
  double on_time = 0;
  Worth total{};
  for (std::size_t which = 0; which < kClasses; ++which) {
    // The smoothing tail weighs one round over all classes.
    const double share = blind ? (which == 0 ? 1.0 : 0.0)
                               : rounds_in_class_[which] / static_cast<double>(law_.size());
    if (share == 0) continue;
    const Duration typical{deadline_.count() / kAlike * static_cast<std::int64_t>(which)};
    Best<std::size_t> level(terms_.target);
    for (std::size_t l = 0; l < count; ++l) {
      const double tail = law_.tail(slack[l] - typical);
      const Chance c =
          chance(hits[l][which], rounds_in_class_[which],
                 (hits[l][which] + share * (1.0 - tail)) / (rounds_in_class_[which] + share));
      level.consider(l, worth(c, quality_of(ladder, l, variant), terms_));
    }
    const auto& [l, best] = *level.get();
    on_time += hits[l][which];
    total.on_time.hedged += share * best.on_time.hedged;
    total.value += share * best.value;
  }
  total.on_time = chance(on_time, static_cast<double>(law_.size()), total.on_time.hedged);
  return total;
}

std::optional<Worth> BudgetOrigin::worth_of(TimePoint now, bool degraded, Duration since,
                                            const Forecast& forecast, bool as_forecast) const {
  Best<std::size_t> best(terms_.target);
  for (std::size_t v = 0; v < forecast.size(); ++v) {
    if (!forecast[v]) continue;
    const Duration clean = since + *forecast[v] + bias(now, key_of(degraded, v), as_forecast);
    best.consider(v, worth_at(clean, static_cast<std::uint8_t>(v)));
  }
  const auto& found = best.get();
  return found ? std::optional(found->second) : std::nullopt;
}

// True for a mode that was not tried for a while, is not known to miss the target, and would be the
// better one if its forecast were right; at most in every so-many-th round.
bool BudgetOrigin::explores(TimePoint now, bool degraded, Duration since, const Forecast& forecast,
                            const std::optional<Worth>& chosen) {
  const auto& at = tried_[degraded ? 1 : 0];
  if (exploration_ < 1.0 || !chosen || (at && now - *at <= kRecent)) return false;
  const auto expected = worth_of(now, degraded, since, forecast);
  if (!expected || misses(*expected, terms_.target)) return false;
  const auto hoped = worth_of(now, degraded, since, forecast, true);
  if (hoped->value <= chosen->value) return false;
  exploration_ -= 1.0;
  return true;
}

bool BudgetOrigin::choose_degraded(TimePoint now, RoundId round, const Sent&, Duration since,
                                   const Forecast& normal, const Forecast& degraded) {
  exploration_ = std::min(1.0, exploration_ + options_.exploration);
  const std::optional<Worth> whole = worth_of(now, false, since, normal);
  const std::optional<Worth> cheap = worth_of(now, true, since, degraded);
  Best<bool> best(terms_.target);
  if (cheap) best.consider(true, *cheap);
  if (whole) best.consider(false, *whole);
  // Without any forecast the smaller message is the safer one.
  bool choice = !best.get() || best.get()->first;
  if (explores(now, !choice, since, choice ? normal : degraded, choice ? cheap : whole)) {
    choice = !choice;
  }
  tried_[choice ? 1 : 0] = now;
  Entry* entry = sent_.enter(round);
  if (entry == nullptr) return choice;
  *entry = {.known = false, .degraded = choice, .forecast = choice ? degraded : normal};
  for (auto& at : entry->forecast) {
    if (at) *at += since;
  }
  return choice;
}

void BudgetOrigin::result(TimePoint now, RoundId round, Duration e2e, const Spent& spent) {
  Entry* entry = sent_.find(round);
  if (entry == nullptr || entry->known || !spent.variant || *spent.variant >= kMaxVariants ||
      !spent.computed) {
    return;
  }
  const auto& forecast = entry->forecast[*spent.variant];
  if (!forecast) return;
  entry->known = true;
  computed_.add(now, 0, spent.computed->count());
  if (configured_.empty()) learnt_[0].median = Duration{*computed_.median_of_all(now)};
  ResidualLaw::Sample sample;
  Duration expected = *spent.computed;
  const auto ladder = levels();
  const std::size_t level = configured_.empty() ? 0 : spent.level.value_or(UINT8_MAX);
  if (level < ladder.size()) {
    sample.run = {level, ladder[level].median, *spent.computed};
    expected = speed_.expected(level, ladder[level].median);
    if (!configured_.empty()) speed_.add(now, level, ladder[level].median, *spent.computed);
  }
  sample.round = round;
  sample.at = now;
  sample.key = key_of(entry->degraded, *spent.variant);
  sample.before = spent.excess.value_or(Duration::zero());
  sample.computed = *spent.computed - expected;
  sample.rest = e2e - *spent.computed - sample.before - *forecast;
  learn(now, sample);
}

void BudgetOrigin::missed(TimePoint now, RoundId round) {
  const Entry* entry = sent_.find(round);
  if (entry == nullptr || entry->known) return;
  const auto planned = std::ranges::find_if(entry->forecast, [](const auto& f) { return !!f; });
  const auto computed = computed_.median_of_all(now);
  if (planned == entry->forecast.end() || !computed) return;
  const std::uint8_t key =
      key_of(entry->degraded, static_cast<std::size_t>(planned - entry->forecast.begin()));
  ResidualLaw::Sample sample;
  sample.round = round;
  sample.at = now;
  sample.key = key;
  sample.kind = ResidualLaw::Sample::Kind::kBeyond;
  sample.rest = deadline_ - **planned - bias(now, key, false) - Duration{*computed};
  learn(now, sample);
}

}  // namespace interneuron::guard
