#include "core/guard/budget_origin.h"

#include <algorithm>

namespace interneuron::guard {
namespace {

// The quality of a smaller variant relative to the best one, where the levels do not say: the paper
// measured a loss of 4 to 8 % (docs/paper.md, "Adjusting quality and size").
constexpr double kSmallerQuality = 0.95;

}  // namespace

BudgetOrigin::BudgetOrigin(const PipelineConfig& config)
    : deadline_(config.deadline),
      terms_{config.guard, config.budget.miss_price, config.fallback.local},
      learns_level_(config.levels.empty()),
      levels_(config.levels) {
  law_.set_scale(deadline_ / kTail);
  if (learns_level_) levels_.push_back({Duration{1}, Duration{1}, {1.0, kSmallerQuality}});
}

Duration BudgetOrigin::error(TimePoint now, std::uint8_t key) const {
  const auto own = law_.base(now, key);
  return own ? *own : law_.base(now, std::nullopt).value_or(Duration::zero());
}

// A mode is worth what the best of its variants is: the others only come sooner where that one is
// late.
std::optional<double> BudgetOrigin::worth_of(TimePoint now, bool degraded, Duration since,
                                             const Forecast& forecast) const {
  const ResidualLaw::Near law = law_.near(std::nullopt, {});
  std::optional<double> best;
  for (std::uint8_t v = 0; v < kMaxVariants; ++v) {
    if (!forecast[v]) continue;
    const Duration left = deadline_ - since - *forecast[v] - error(now, key_of(degraded, v));
    const double value = best_level(levels_, v, law, speed_, now, left, terms_).second;
    best = std::max(best.value_or(value), value);
  }
  return best;
}

bool BudgetOrigin::choose_degraded(TimePoint now, RoundId round, const Sent&, Duration since,
                                   const Forecast& normal, const Forecast& degraded) {
  const auto whole = worth_of(now, false, since, normal);
  const auto cheap = worth_of(now, true, since, degraded);
  // The smaller message is the safer one.
  const bool choice = !whole || (cheap && *cheap >= *whole);
  if (Entry* entry = sent_.enter(round)) {
    *entry = {.known = false, .degraded = choice, .forecast = choice ? degraded : normal};
    for (auto& at : entry->forecast) {
      if (at) *at += since;
    }
  }
  return choice;
}

void BudgetOrigin::result(TimePoint now, RoundId round, Duration e2e, const Spent& spent) {
  Entry* entry = sent_.find(round);
  if (entry == nullptr || entry->known || !spent.variant || *spent.variant >= kMaxVariants ||
      !spent.computed || !entry->forecast[*spent.variant]) {
    return;
  }
  entry->known = true;
  computed_.add(now, 0, spent.computed->count());
  if (learns_level_) levels_[0].median = Duration{*computed_.median_of_all(now)};
  Duration expected = *spent.computed;
  const std::size_t level = learns_level_ ? 0 : spent.level.value_or(UINT8_MAX);
  if (level < levels_.size()) {
    expected = speed_.expected(now, level, levels_[level].median);
    speed_.add(now, level, levels_[level].median, *spent.computed);
  }
  law_.add(now, {.round = round,
                 .key = key_of(entry->degraded, *spent.variant),
                 .before = {},
                 .computed = *spent.computed - expected,
                 .rest = e2e - *spent.computed - *entry->forecast[*spent.variant]});
}

void BudgetOrigin::missed(TimePoint now, RoundId round) {
  const Entry* entry = sent_.find(round);
  if (entry == nullptr || entry->known) return;
  const auto planned = std::ranges::find_if(entry->forecast, [](const auto& f) { return !!f; });
  const auto computed = computed_.median_of_all(now);
  if (planned == entry->forecast.end() || !computed) return;
  const std::uint8_t key =
      key_of(entry->degraded, static_cast<std::size_t>(planned - entry->forecast.begin()));
  law_.add(now, {.round = round,
                 .key = key,
                 .rest = deadline_ - **planned - error(now, key) - Duration{*computed},
                 .answered = false});
}

}  // namespace interneuron::guard
