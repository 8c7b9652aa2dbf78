#include "lab/eval/bounds.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "lab/sim/offload.h"

namespace interneuron::eval {
namespace {

using emu::Direction;

Duration runtime(const Profile& profile, std::size_t level, double deviations) {
  return sim::runtime_of(profile.levels[level].median, profile.levels[level].p95, deviations);
}

Duration injected_in(const Injected& injected, Module module) {
  return injected.any && injected.module == module ? injected.delay : Duration{};
}

// By how much a frame is delayed on a link.
Duration injected_on(const Injected& injected, std::size_t link) {
  return injected.link.value_or(link) == link ? injected_in(injected, Module::kUplink) : Duration{};
}

// The best answer of a missed round; `before`: what was shown in the rounds before it.
Shown best_fallback(const Profile& profile, const std::vector<Shown>& before) {
  Shown best{Shown::Kind::kLocal, 0, 0, 0};
  const std::size_t oldest = std::min(before.size(), profile.fallback.stale_share.size());
  for (std::uint32_t age = 1; age <= oldest; ++age) {
    Shown stale = before[before.size() - age];
    if (stale.kind != Shown::Kind::kRemote) continue;
    stale.kind = Shown::Kind::kStale;
    stale.age = age;
    if (quality_of(profile, stale) > quality_of(profile, best)) best = stale;
  }
  return best;
}

// `shown`: nothing for a miss.
void add_round(const Profile& profile, const std::optional<Shown>& shown, Bound& bound) {
  if (!shown) ++bound.timeouts;
  bound.shown.push_back(shown.value_or(best_fallback(profile, bound.shown)));
  bound.quality += quality_of(profile, bound.shown.back());
}

void finish(Bound& bound) {
  bound.quality /= std::max(1.0, static_cast<double>(bound.shown.size()));
}

// --- oracle

class Oracle {
 public:
  Oracle(const Scenario& scenario, const Trace& trace, std::uint64_t seed)
      : scenario_(scenario), trace_(trace), reach_(scenario, seed) {}

  // The best remote answer by the deadline, if there is one.
  std::optional<Shown> best(std::size_t round);

 private:
  const Scenario& scenario_;
  const Trace& trace_;
  Reach reach_;
};

std::optional<Shown> Oracle::best(std::size_t round) {
  const Profile& profile = scenario_.profile;
  const Injected& injected = trace_.rounds[round];
  const Duration t0 = sim::kWarmUp + static_cast<std::int64_t>(round) * scenario_.period;
  const Duration deadline = t0 + scenario_.deadline;
  std::optional<Shown> best;
  for (std::size_t v = 0; v < profile.variants.size(); ++v) {
    const Duration there =
        reach_.soonest(Direction::kUp, t0 + scenario_.hosts.encode, profile.variants[v].bytes,
                       [&injected](std::size_t link) { return injected_on(injected, link); });
    if (there >= deadline) continue;
    const Duration begins = there + injected_in(injected, Module::kBeforeCompute);
    for (std::size_t level = 0; level < profile.levels.size(); ++level) {
      const Shown shown{Shown::Kind::kRemote, level, static_cast<std::uint8_t>(v), 0};
      if (best && quality_of(profile, shown) <= quality_of(profile, *best)) continue;
      const Duration ends = begins + runtime(profile, level, trace_.compute_noise[round]) +
                            injected_in(injected, Module::kInsideCompute);
      if (ends >= deadline) continue;
      const Duration back = reach_.soonest(Direction::kDown, ends, sim::kResultBytes) +
                            injected_in(injected, Module::kDownlink);
      if (back <= deadline) best = shown;
    }
  }
  return best;
}

// --- causal

// Quantiles that the law is cut into: those of the uniform law are 1 ms apart or less.
constexpr int kCuts = 64;

class Causal {
 public:
  Causal(const Scenario& scenario, double miss_price);

  std::size_t choose_variant(double p_injected, double fallback) const;
  // For a computation that begins `late`; `seen`: what was injected into the round is part of that,
  // so that nothing more will come.
  std::size_t choose_level(std::size_t variant, Duration late, bool seen, double p_injected,
                           double fallback) const;
  // When the computation on a variant begins if nothing is injected, after t0.
  Duration begins(std::size_t variant) const { return begins_[variant]; }
  bool is_on_time(std::size_t variant, std::size_t level, const Injected& injected,
                  double deviations) const;

 private:
  double value(std::size_t variant, std::size_t level, Duration late, bool seen, double p_injected,
               double fallback) const;
  double best_value(std::size_t variant, Duration late, bool seen, double p_injected,
                    double fallback) const;
  double p_done_within(std::size_t level, Duration budget) const;

  const Profile& profile_;
  double miss_price_;
  // By variant: what is left for the computation and every delay.
  std::vector<Duration> slack_;
  std::vector<Duration> begins_;
  std::vector<Duration> cuts_;
};

Causal::Causal(const Scenario& scenario, double miss_price)
    : profile_(scenario.profile), miss_price_(miss_price) {
  Reach reach(scenario, 0);
  for (const VariantProfile& variant : profile_.variants) {
    const Duration there = reach.soonest(Direction::kUp, scenario.hosts.encode, variant.bytes);
    begins_.push_back(there);
    slack_.push_back(scenario.deadline - reach.soonest(Direction::kDown, there, sim::kResultBytes));
  }
  for (int i = 0; i < kCuts; ++i) cuts_.push_back(delay_at(scenario.law, (i + 0.5) / kCuts));
}

// Run times are half-normal, see sim::runtime_of().
double Causal::p_done_within(std::size_t level, Duration budget) const {
  const Duration usual = runtime(profile_, level, 0);
  const Duration deviation = runtime(profile_, level, 1) - usual;
  if (deviation <= Duration{}) return budget >= usual ? 1 : 0;
  const double deviations = to_ms(budget - usual) / to_ms(deviation);
  const double normal = deviations - sim::half_normal_deviations(0);
  return normal <= 0 ? 0 : std::erf(normal / std::numbers::sqrt2);
}

double Causal::value(std::size_t variant, std::size_t level, Duration late, bool seen,
                     double p_injected, double fallback) const {
  double p = p_done_within(level, slack_[variant] - late);
  if (!seen) {
    // Half of the modules are still ahead.
    const double ahead = p_injected / 2 / (1 - p_injected / 2);
    double delayed = 0;
    for (const Duration delay : cuts_) {
      delayed += p_done_within(level, slack_[variant] - late - delay);
    }
    p = (1 - ahead) * p + ahead * delayed / kCuts;
  }
  return p * remote_quality(profile_, level, variant) + (1 - p) * (fallback - miss_price_);
}

std::size_t Causal::choose_level(std::size_t variant, Duration late, bool seen, double p_injected,
                                 double fallback) const {
  std::size_t best = 0;
  double most = value(variant, 0, late, seen, p_injected, fallback);
  for (std::size_t level = 1; level < profile_.levels.size(); ++level) {
    const double v = value(variant, level, late, seen, p_injected, fallback);
    if (v <= most) continue;
    best = level;
    most = v;
  }
  return best;
}

double Causal::best_value(std::size_t variant, Duration late, bool seen, double p_injected,
                          double fallback) const {
  return value(variant, choose_level(variant, late, seen, p_injected, fallback), late, seen,
               p_injected, fallback);
}

std::size_t Causal::choose_variant(double p_injected, double fallback) const {
  std::size_t best = 0;
  double most = 0;
  for (std::size_t variant = 0; variant < profile_.variants.size(); ++variant) {
    double seen = 0;
    for (const Duration delay : cuts_) {
      seen += best_value(variant, delay, true, p_injected, fallback);
    }
    const double v = p_injected / 2 * seen / kCuts +
                     (1 - p_injected / 2) * best_value(variant, {}, false, p_injected, fallback);
    if (variant > 0 && v <= most) continue;
    best = variant;
    most = v;
  }
  return best;
}

bool Causal::is_on_time(std::size_t variant, std::size_t level, const Injected& injected,
                        double deviations) const {
  const Duration delay = injected.any ? injected.delay : Duration{};
  return runtime(profile_, level, deviations) + delay <= slack_[variant];
}

// Whether a delay of the round lies behind it when its computation begins.
bool is_seen(const Injected& injected) {
  return injected.any &&
         (injected.module == Module::kUplink || injected.module == Module::kBeforeCompute);
}

// The probability that a round is injected, by the round before.
double p_injected_after(const Injected& before, const BurstChain& chain) {
  return before.any ? 1 - chain.ends : chain.begins;
}

}  // namespace

bool is_known_to_causal(const Scenario& scenario) {
  return has_constant_links(scenario) && scenario.law.modules == DelayLaw{}.modules &&
         !scenario.law.uplink_of;
}

Bound oracle(const Scenario& scenario, const Trace& trace, std::uint64_t seed) {
  Oracle oracle(scenario, trace, seed);
  Bound bound;
  for (std::size_t i = 0; i < trace.rounds.size(); ++i) {
    add_round(scenario.profile, oracle.best(i), bound);
  }
  finish(bound);
  return bound;
}

std::optional<Bound> causal(const Scenario& scenario, const Trace& trace, double miss_price) {
  if (!is_known_to_causal(scenario)) return std::nullopt;
  const Causal causal(scenario, miss_price);
  const BurstChain chain = burst_chain(scenario.law);
  const bool injects = scenario.law.shape != DelayLaw::Shape::kNone;
  double p_injected = injects ? scenario.law.share : 0;
  Bound bound;
  for (std::size_t i = 0; i < trace.rounds.size(); ++i) {
    const Injected& injected = trace.rounds[i];
    const double fallback =
        quality_of(scenario.profile, best_fallback(scenario.profile, bound.shown));
    const std::size_t variant = causal.choose_variant(p_injected, fallback);
    const bool seen = is_seen(injected);
    const std::size_t level = causal.choose_level(variant, seen ? injected.delay : Duration{}, seen,
                                                  p_injected, fallback);
    std::optional<Shown> shown;
    if (causal.is_on_time(variant, level, injected, trace.compute_noise[i])) {
      shown = Shown{Shown::Kind::kRemote, level, static_cast<std::uint8_t>(variant), 0};
    }
    add_round(scenario.profile, shown, bound);
    p_injected = p_injected_after(injected, chain);
  }
  finish(bound);
  return bound;
}

std::optional<Player> causal_player(const Scenario& scenario, const Trace& trace,
                                    double miss_price) {
  if (!is_known_to_causal(scenario)) return std::nullopt;
  const auto causal = std::make_shared<const Causal>(scenario, miss_price);
  const double fallback = scenario.profile.fallback.local;
  const std::size_t variant = causal->choose_variant(scenario.law.share, fallback);
  const auto level = [causal, chain = burst_chain(scenario.law), variant, fallback, &scenario,
                      &trace](std::uint32_t round, Duration, Duration began) {
    const double p =
        round == 0 ? scenario.law.share : p_injected_after(trace.rounds[round - 1], chain);
    return causal->choose_level(variant, began - causal->begins(variant),
                                is_seen(trace.rounds[round]), p, fallback);
  };
  return Player{static_cast<std::uint8_t>(variant), level};
}

}  // namespace interneuron::eval
