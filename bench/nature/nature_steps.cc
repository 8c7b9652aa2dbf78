#include "bench/nature/nature_steps.h"

#include <algorithm>
#include <cmath>

namespace interneuron::bench {
namespace {

double score(const Nature& nature, Quantity quantity) {
  switch (quantity) {
    case Quantity::kRtt:
      return nature.delay;
    case Quantity::kLoss:
      return nature.reliability;
    case Quantity::kRate:
      break;
  }
  return nature.bandwidth;
}

double value(const Conditions& conditions, Quantity quantity) {
  switch (quantity) {
    case Quantity::kRtt:
      return conditions.rtt_ms;
    case Quantity::kLoss:
      return conditions.loss;
    case Quantity::kRate:
      break;
  }
  return conditions.rate_mbit;
}

// Keeps in `since` the time from which something has held without a break; empty while it does not
// hold.
void keep_first(std::optional<Duration>& since, bool holds, Duration at) {
  if (!holds) {
    since.reset();
  } else if (!since) {
    since = at;
  }
}

}  // namespace

const char* unit_of(Quantity quantity) {
  switch (quantity) {
    case Quantity::kRtt:
      return "ms";
    case Quantity::kLoss:
      return "ratio";
    case Quantity::kRate:
      break;
  }
  return "mbit";
}

const char* name_of(Quantity quantity) {
  switch (quantity) {
    case Quantity::kRtt:
      return "rtt";
    case Quantity::kLoss:
      return "loss";
    case Quantity::kRate:
      break;
  }
  return "rate";
}

double Step::from() const { return value(before, what); }
double Step::to() const { return value(after, what); }

std::vector<Step> steps() {
  Conditions slow = kBase;
  slow.rtt_ms = 90;
  Conditions lossy = kBase;
  lossy.loss = 0.05;
  Conditions narrow = kBase;
  narrow.rate_mbit = 15;
  return {{Quantity::kRtt, kBase, slow},    {Quantity::kRtt, slow, kBase},
          {Quantity::kRate, kBase, narrow}, {Quantity::kRate, narrow, kBase},
          {Quantity::kLoss, kBase, lossy},  {Quantity::kLoss, lossy, kBase}};
}

double Belief::of(Quantity quantity) const {
  switch (quantity) {
    case Quantity::kRtt:
      return rtt_ms;
    case Quantity::kLoss:
      return loss;
    case Quantity::kRate:
      break;
  }
  return rate_mbit;
}

double tolerance(Quantity quantity, double truth, bool loaded) {
  switch (quantity) {
    case Quantity::kRtt:
      return loaded ? 0.1 * truth : std::max(0.5, 0.02 * truth);
    case Quantity::kLoss:
      return std::max(0.005, 0.3 * truth);
    case Quantity::kRate:
      break;
  }
  return (loaded ? 0.10 : 0.15) * truth;
}

Convergence converge(const Step& step, bool loaded, Duration began,
                     std::span<const Belief> beliefs) {
  Convergence out;
  const bool more_is_better = step.what == Quantity::kRate;
  const bool best = (step.to() > value(kReference, step.what)) == more_is_better;
  const double bound = tolerance(step.what, step.to(), loaded);
  for (const Belief& belief : beliefs) {
    const double now = belief.of(step.what);
    const bool nearer = std::abs(now - step.to()) < std::abs(now - step.from());
    if (nearer && !out.noticed) out.noticed = belief.at - began;
    keep_first(out.settled, std::abs(now - step.to()) <= bound, belief.at - began);
    const double own = score(belief.nature, step.what);
    const double other = score(belief.reference, step.what);
    keep_first(out.ranked, best ? own > other : own < other, belief.at - began);
    out.last = now;
  }
  return out;
}

OutageNotice notice(Duration began, std::span<const PathStep> steps) {
  OutageNotice out;
  const Duration ended = began + kOutage;
  for (const PathStep& step : steps) {
    if (step.at < began) continue;
    const bool usable = step.to == PathState::kOk || step.to == PathState::kSuspect;
    if (step.to != PathState::kOk && !out.suspected) out.suspected = step.at - began;
    if (!usable && !out.abandoned) out.abandoned = step.at - began;
    if (step.at >= ended && step.to == PathState::kOk && !out.back) out.back = step.at - ended;
  }
  return out;
}

}  // namespace interneuron::bench
