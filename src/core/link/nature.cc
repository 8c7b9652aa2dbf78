#include "core/link/nature.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace interneuron::link {
namespace {

// Seconds per nanosecond.
constexpr double kSeconds = 1e-9;
// How many standard errors tell two links apart: at the edge one pair in 20 is ordered wrongly.
constexpr double kStandardErrors = 1.64;
// The standard deviation of normal values in terms of their mean deviation, which RTTVAR follows.
constexpr double kSdPerMeanDeviation = 1.25;
// What the network of a link is worth when the operator trusts it (docs/paper.md, "Nature").
constexpr double kTrustedSecurity = 0.5;
constexpr double kEncryptedSecurity = 0.5;
// Standard error of the 95 % quantile of n normal values, in sd / sqrt(n).
constexpr double kP95Error = 2.1;
// Delays that differ by less than this share are alike to every application.
constexpr double kDelayApart = 0.02;

// Evidence without any confidence counts as half as good.
double discount(double confidence) { return kUnmeasured + (1.0 - kUnmeasured) * confidence; }

double fresh(const LinkState& link) { return confidence(link.age, kGrace, kHalfLife); }

double fresh_rate(const LinkState& link) {
  return confidence(link.rate_age, kRateGrace, kRateHalfLife);
}

// Each measure is "smaller is better" and positive; nothing while not measured.
using Measure = std::optional<double> (*)(const LinkState&);

std::optional<double> delay(const LinkState& link) {
  if (link.rtt_p95 <= Duration::zero()) return std::nullopt;
  const double ns = static_cast<double>(link.rtt_p95.count()) / 2 +
                    static_cast<double>(std::max(link.queue_up, Duration::zero()).count());
  return ns / discount(fresh(link));
}

std::optional<double> rate(const LinkState& link) {
  if (link.rate <= DataRate{}) return std::nullopt;
  return static_cast<double>(link.rate.bits_per_second) * discount(fresh_rate(link));
}

std::optional<double> risk(const LinkState& link) {
  if (link.rtt_p95 <= Duration::zero()) return std::nullopt;
  const double uptime = std::max(kLeastUptime, 1.0 - link.outage);
  return std::max(kLossFloor, link.loss) / uptime / discount(fresh(link));
}

enum class Better { kSmaller, kLarger };

struct Range {
  std::optional<double> smallest;
  std::optional<double> largest;
};

Range range_of(std::span<const LinkState> links, Measure measure) {
  Range range;
  for (const LinkState& link : links) {
    const auto value = link.up ? measure(link) : std::nullopt;
    if (!value) continue;
    range.smallest = std::min(*value, range.smallest.value_or(*value));
    range.largest = std::max(*value, range.largest.value_or(*value));
  }
  return range;
}

void score_field(std::span<LinkState> links, double Nature::*field, Measure measure,
                 Better better) {
  const Range range = range_of(links, measure);
  const double unmeasured = range.smallest ? kUnmeasured * (*range.smallest / *range.largest) : 1.0;
  for (LinkState& link : links) {
    const auto value = link.up ? measure(link) : std::nullopt;
    double& score = link.nature.*field;
    if (value) {
      score = better == Better::kSmaller ? *range.smallest / *value : *value / *range.largest;
    } else {
      score = link.up ? unmeasured : 0.0;
    }
  }
}

Reason reason(const LinkState& link, std::span<const LinkState> links, Measure measure,
              Better better, double confidence, double unit) {
  const Range range = range_of(links, measure);
  const auto value = measure(link);
  const auto best = better == Better::kSmaller ? range.smallest : range.largest;
  return {value.value_or(0) * unit, best.value_or(0) * unit, confidence, value.has_value()};
}

// A quantity of which smaller is better, and the square of its standard error.
struct Estimate {
  double value = 0;
  double variance = 0;
};

std::optional<Estimate> delay_estimate(const LinkState& link) {
  if (link.rtt_p95 <= Duration::zero() || link.rtt_samples == 0) return std::nullopt;
  const double ns = static_cast<double>((link.rtt_p95 / 2 + link.queue_up).count());
  // The delay is half a round trip, and so is its deviation.
  const double sd = kSdPerMeanDeviation * static_cast<double>(link.jitter.count()) / 2;
  return Estimate{ns, kP95Error * kP95Error * sd * sd / link.rtt_samples};
}

std::optional<Estimate> loss_estimate(const LinkState& link) {
  if (link.loss_packets == 0) return std::nullopt;
  const double n = link.loss_packets;
  const double p = std::min(0.5, (link.loss * n + 1) / (n + 1));
  return Estimate{link.loss, p * (1 - p) * std::max(1.0, 2 * link.loss_burst - 1) / n};
}

std::partial_ordering apart(const std::optional<Estimate>& a, const std::optional<Estimate>& b,
                            double least) {
  if (!a || !b) return std::partial_ordering::unordered;
  const double off = std::abs(a->value - b->value);
  if (off <= least || off <= kStandardErrors * std::sqrt(a->variance + b->variance)) {
    return std::partial_ordering::unordered;
  }
  return b->value <=> a->value;
}

}  // namespace

std::partial_ordering compare(const LinkState& a, const LinkState& b, Field field) {
  switch (field) {
    case Field::kDelay: {
      const auto x = delay_estimate(a);
      const auto y = delay_estimate(b);
      const auto seen = apart(x, y, x && y ? kDelayApart * std::min(x->value, y->value) : 0);
      return seen == b.rtt_min <=> a.rtt_min ? seen : std::partial_ordering::unordered;
    }
    case Field::kBandwidth: {
      if (a.rate_trains == 0 || b.rate_trains == 0) break;
      const auto [low, high] = std::minmax(a.rate, b.rate);
      if (high < low.scaled(kRateApart)) break;
      return a.rate <=> b.rate;
    }
    case Field::kReliability:
      return apart(loss_estimate(a), loss_estimate(b), 0);
  }
  return std::partial_ordering::unordered;
}

double confidence(Duration age, Duration grace, Duration half_life) {
  if (age == Duration::max()) return 0;
  if (age <= grace) return 1;
  return std::exp2(-static_cast<double>((age - grace).count()) /
                   static_cast<double>(half_life.count()));
}

void score(std::span<LinkState> links) {
  score_field(links, &Nature::delay, delay, Better::kSmaller);
  score_field(links, &Nature::bandwidth, rate, Better::kLarger);
  score_field(links, &Nature::reliability, risk, Better::kSmaller);
  for (LinkState& link : links) {
    const double known =
        (link.traits.trusted ? kTrustedSecurity : 0) + (link.encrypted ? kEncryptedSecurity : 0);
    link.nature.security = link.up ? known : 0;
  }
}

Evidence explain(const LinkState& link, std::span<const LinkState> links) {
  return Evidence{.delay = reason(link, links, delay, Better::kSmaller, fresh(link), kSeconds),
                  .bandwidth = reason(link, links, rate, Better::kLarger, fresh_rate(link), 1),
                  .reliability = reason(link, links, risk, Better::kSmaller, fresh(link), 1),
                  .trusted = link.traits.trusted,
                  .encrypted = link.encrypted};
}

}  // namespace interneuron::link
