#include "lab/load/on_time_fit.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace interneuron::load {
namespace {

// Newton's method ends after so many steps, or where no weight moves by more.
constexpr int kMostSteps = 25;
constexpr double kStill = 1e-4;
// No weight moves by more in a step: where nearly all are on time the curvature says little.
constexpr double kMostStep = 3;
constexpr double kLeastSteep = 1e-6;
// The ridge of each weight, which keeps one of what never varies at 0, and that of the first, which
// is the weight of 1. No measurement behind these values: they only have to be small beside
// thousands of messages.
constexpr double kRidge = 2;
constexpr double kLeastRidge = 1e-6;
// Between these quantiles of what was said lies each knot, and so far apart they are at least.
constexpr std::array kQuantiles{0.0,  0.01, 0.03, 0.06, 0.12, 0.2, 0.3,
                                0.42, 0.56, 0.72, 0.86, 0.95, 1.0};
static_assert(kQuantiles.size() == std::tuple_size_v<decltype(OnTimeLaw::knots)> + 1);
constexpr double kLeastGap = 1e-3;
// Of so many messages more than there were, half are taken to have been on time: a share is neither
// 0 nor 1.
constexpr double kPriorMessages = 1;

using Weights = OnTimeFeatures;
using Matrix = std::array<Weights, kOnTimeFeatures>;

double chance(double log_odds) { return 1 / (1 + std::exp(-log_odds)); }

template <class Features>
double sum(const Weights& weights, const Features& features) {
  double out = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) out += weights[i] * features[i];
  return out;
}

// x of a x = b for a symmetric positive definite a (Cholesky).
Weights solve(Matrix a, Weights b) {
  const std::size_t n = b.size();
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t k = 0; k < j; ++k) a[j][j] -= a[j][k] * a[j][k];
    a[j][j] = std::sqrt(a[j][j]);
    for (std::size_t i = j + 1; i < n; ++i) {
      for (std::size_t k = 0; k < j; ++k) a[i][j] -= a[i][k] * a[j][k];
      a[i][j] /= a[j][j];
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < i; ++k) b[i] -= a[i][k] * b[k];
    b[i] /= a[i][i];
  }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t k = i + 1; k < n; ++k) b[i] -= a[k][i] * b[k];
    b[i] /= a[i][i];
  }
  return b;
}

// Where the slope of the logarithmic loss, with the ridge, would be 0 if its curvature was the same
// everywhere, from these weights.
template <class Samples>
Weights newton_step(const Weights& weights, const Samples& samples) {
  Matrix curvature{};
  Weights slope{};
  for (std::size_t i = 0; i < slope.size(); ++i) {
    curvature[i][i] = i == 0 ? kLeastRidge : kRidge;
    slope[i] = -curvature[i][i] * weights[i];
  }
  for (const auto& s : samples) {
    const double p = chance(sum(weights, s.features));
    const double off = (s.on_time ? 1 : 0) - p;
    const double steep = std::max(p * (1 - p), kLeastSteep);
    for (std::size_t i = 0; i < slope.size(); ++i) {
      const double f = s.features[i];
      if (f == 0) continue;
      slope[i] += off * f;
      for (std::size_t j = 0; j <= i; ++j) curvature[i][j] += steep * f * s.features[j];
    }
  }
  return solve(curvature, slope);
}

// Neighbours of what was said: the mean of that, and the share on time.
struct Part {
  double said = 0;
  double seen = 0;
  double messages = 0;
};

std::vector<Part> parts_of(std::span<const std::pair<double, bool>> said) {
  std::vector<Part> out;
  const auto n = static_cast<double>(said.size());
  for (std::size_t q = 0; q + 1 < kQuantiles.size(); ++q) {
    const auto from = static_cast<std::size_t>(kQuantiles[q] * n);
    const auto to = static_cast<std::size_t>(kQuantiles[q + 1] * n);
    Part part;
    for (std::size_t i = from; i < to; ++i) {
      part.said += said[i].first;
      part.seen += said[i].second ? 1 : 0;
    }
    part.messages = static_cast<double>(to - from);
    part.said /= std::max(part.messages, 1.0);
    // Few messages say little.
    part.seen = (part.seen + kPriorMessages / 2) / (part.messages + kPriorMessages);
    out.push_back(part);
  }
  return out;
}

// What was seen is made not to fall by pooling neighbours (pool adjacent violators).
std::vector<double> rising(const std::vector<Part>& parts) {
  std::vector<std::pair<Part, std::size_t>> pools;
  for (const Part& part : parts) {
    pools.emplace_back(part, 1);
    while (pools.size() > 1 && pools[pools.size() - 2].first.seen > pools.back().first.seen) {
      const auto [last, count] = pools.back();
      pools.pop_back();
      Part& into = pools.back().first;
      const double messages = std::max(into.messages + last.messages, 1.0);
      into.seen = (into.seen * into.messages + last.seen * last.messages) / messages;
      into.messages += last.messages;
      pools.back().second += count;
    }
  }
  std::vector<double> out;
  for (const auto& [pool, count] : pools) out.insert(out.end(), count, pool.seen);
  return out;
}

decltype(OnTimeLaw::knots) knots_of(std::span<const std::pair<double, bool>> said) {
  const std::vector<Part> parts = parts_of(said);
  const std::vector<double> seen = rising(parts);
  decltype(OnTimeLaw::knots) out{};
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k] = {parts[k].said, std::log(seen[k] / (1 - seen[k]))};
    if (k > 0) out[k].said = std::max(out[k].said, out[k - 1].said + kLeastGap);
  }
  return out;
}

}  // namespace

std::vector<Forecast> replayed(std::span<const ForecastStep> steps, const OnTimeLaws& laws) {
  OnTimeForecasts forecasts(laws);
  std::vector<Forecast> out;
  for (const ForecastStep& step : steps) {
    if (!step.is_message) {
      forecasts.settled(step.fate);
      continue;
    }
    const OnTimePrediction predicted = forecasts.predict(step.outlook);
    if (step.judged) {
      out.push_back(step.forecast);
      out.back().predicted = predicted.probability;
    }
    if (step.id != SendId{}) forecasts.sent(step.id, step.outlook, predicted);
  }
  return out;
}

void OnTimeFit::add(std::span<const ForecastStep> steps) {
  OnTimeForecasts forecasts;
  for (const ForecastStep& step : steps) {
    if (!step.is_message) {
      forecasts.settled(step.fate);
      continue;
    }
    if (step.judged) {
      Sample sample;
      std::ranges::transform(forecasts.features(step.outlook), sample.features.begin(),
                             [](double v) { return static_cast<float>(v); });
      sample.on_time = step.forecast.on_time;
      samples_.at(static_cast<std::size_t>(forecasts.case_of(step.outlook))).push_back(sample);
    }
    if (step.id != SendId{}) forecasts.sent(step.id, step.outlook, forecasts.predict(step.outlook));
  }
}

void OnTimeFit::add(OnTimeFit&& other) {
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    samples_[i].insert(samples_[i].end(), other.samples_[i].begin(), other.samples_[i].end());
    other.samples_[i] = {};
  }
}

std::array<std::size_t, 3> OnTimeFit::messages() const {
  return {samples_[0].size(), samples_[1].size(), samples_[2].size()};
}

OnTimeLaw OnTimeFit::law(std::span<const Sample> samples) {
  OnTimeLaw out{};
  for (int step = 0; step < kMostSteps; ++step) {
    const Weights by = newton_step(out.weights, samples);
    double most = 0;
    for (std::size_t i = 0; i < by.size(); ++i) {
      out.weights[i] += std::clamp(by[i], -kMostStep, kMostStep);
      most = std::max(most, std::abs(by[i]));
    }
    if (most < kStill) break;
  }
  std::vector<std::pair<double, bool>> said;
  said.reserve(samples.size());
  for (const Sample& s : samples) said.emplace_back(sum(out.weights, s.features), s.on_time);
  // Those of which it says the same stay mixed.
  std::ranges::stable_sort(said, {}, &std::pair<double, bool>::first);
  out.knots = knots_of(said);
  return out;
}

OnTimeLaws OnTimeFit::laws() const {
  OnTimeLaws out{};
  const std::array<OnTimeLaw*, 3> laws{&out.idle, &out.loaded, &out.refused};
  for (std::size_t i = 0; i < laws.size(); ++i) {
    if (!samples_[i].empty()) *laws[i] = law(samples_[i]);
  }
  return out;
}

}  // namespace interneuron::load
