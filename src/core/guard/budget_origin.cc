#include "core/guard/origins.h"

#include <algorithm>

namespace interneuron::guard {
namespace {

// The quality of a variant relative to the next better one, where the levels do not say: the paper
// measured a loss of 4 to 8 % (docs/paper.md, "Adjusting quality and size").
constexpr double kSmallerQuality = 0.95;

// The best variant of a mode; kMaxVariants: it has none.
std::size_t best_of(const Forecast& mode) {
  const auto best = std::ranges::find_if(mode, [](const auto& f) { return !!f; });
  return static_cast<std::size_t>(best - mode.begin());
}

}  // namespace

BudgetOrigin::BudgetOrigin(const PipelineConfig& config)
    : deadline_(config.deadline),
      terms_{config.guard, config.budget.miss_price, config.fallback.local},
      learns_level_(config.levels.empty()),
      levels_(config.levels) {
  law_.set_scale(deadline_ / kTail);
  if (!learns_level_) return;
  levels_.push_back({Duration{1}, Duration{1}, {1.0}});
  auto& quality = levels_[0].quality;
  while (quality.size() < kMaxVariants) quality.push_back(quality.back() * kSmallerQuality);
}

Duration BudgetOrigin::error(TimePoint now, std::uint8_t key) const {
  const auto own = law_.base(now, key);
  return own ? *own : law_.base(now, std::nullopt).value_or(Duration::zero());
}

// A mode is worth what its best variant is: the others only come sooner where that one is late.
std::size_t BudgetOrigin::choose_mode(TimePoint now, RoundId round, Duration since,
                                      std::span<const Forecast> modes) {
  const ResidualLaw::Near law = law_.near(std::nullopt, {});
  std::size_t choice = modes.size() - 1;
  std::optional<double> most;
  for (std::size_t mode = modes.size(); mode-- > 0;) {
    const std::size_t v = best_of(modes[mode]);
    if (v == kMaxVariants) continue;
    const Duration left = deadline_ - since - *modes[mode][v] - error(now, key_of(v, v));
    const auto variant = static_cast<std::uint8_t>(v);
    const double worth = best_level(levels_, variant, law, speed_, now, left, terms_).second;
    if (most && worth <= *most) continue;
    most = worth;
    choice = mode;
  }
  if (Entry* entry = sent_.enter(round)) {
    *entry = {.known = false, .forecast = modes[choice]};
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
                 .key = key_of(*spent.variant, best_of(entry->forecast)),
                 .computed = *spent.computed - expected,
                 .rest = e2e - *spent.computed - *entry->forecast[*spent.variant]});
}

void BudgetOrigin::missed(TimePoint now, RoundId round) {
  const Entry* entry = sent_.find(round);
  if (entry == nullptr || entry->known) return;
  const std::size_t planned = best_of(entry->forecast);
  const auto computed = computed_.median_of_all(now);
  if (planned == kMaxVariants || !computed) return;
  const std::uint8_t key = key_of(planned, planned);
  law_.add(now,
           {.round = round,
            .key = key,
            .rest = deadline_ - *entry->forecast[planned] - error(now, key) - Duration{*computed},
            .answered = false});
}

}  // namespace interneuron::guard
