#include "lab/load/forecast.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

namespace interneuron::load {
namespace {

// Two percentage points, and how many standard errors chance may add.
constexpr double kTolerance = 0.02;
constexpr double kErrors = 3;
// Where bins end: finer where most predictions are, and where a point matters most.
constexpr std::array kEdges{0.01, 0.02, 0.05, 0.1, 0.2,  0.3,  0.4,  0.5,
                            0.6,  0.7,  0.8,  0.9, 0.95, 0.98, 0.99, 1.0};

std::size_t bin_of(double predicted) {
  const auto* const at = std::ranges::lower_bound(kEdges, predicted);
  return std::min<std::size_t>(static_cast<std::size_t>(at - kEdges.begin()), kEdges.size() - 1);
}

// The root of the summed squares of the seconds' excess over the bin's gap (Liang and Zeger,
// Longitudinal Data Analysis Using Generalized Linear Models, 1986).
Bin judged(std::span<const Forecast> bin) {
  Bin out{.messages = bin.size()};
  const auto n = static_cast<double>(bin.size());
  for (const Forecast& f : bin) {
    out.predicted += f.predicted / n;
    out.happened += (f.on_time ? 1.0 : 0.0) / n;
  }
  std::unordered_map<std::uint64_t, double> seconds;
  for (const Forecast& f : bin) {
    seconds[f.second] += (f.on_time ? 1.0 : 0.0) - f.predicted - out.gap();
  }
  double squares = 0;
  for (const auto& [second, excess] : seconds) squares += excess * excess;
  const auto clusters = static_cast<double>(seconds.size());
  if (clusters > 1) out.standard_error = std::sqrt(squares * clusters / (clusters - 1)) / n;
  return out;
}

}  // namespace

bool Bin::kept() const { return std::abs(gap()) <= kTolerance + kErrors * standard_error; }

double brier_score(std::span<const Forecast> forecasts) {
  double sum = 0;
  for (const Forecast& f : forecasts) {
    const double off = f.predicted - (f.on_time ? 1.0 : 0.0);
    sum += off * off;
  }
  return forecasts.empty() ? 0 : sum / static_cast<double>(forecasts.size());
}

std::vector<Bin> calibration(std::span<const Forecast> forecasts, std::size_t least) {
  std::vector<Forecast> sorted(forecasts.begin(), forecasts.end());
  std::ranges::stable_sort(sorted, {}, &Forecast::predicted);
  // Where each bin ends; each but the last has enough.
  std::vector<std::size_t> ends;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const bool last = i + 1 == sorted.size();
    if (!last && bin_of(sorted[i].predicted) == bin_of(sorted[i + 1].predicted)) continue;
    if (!last && i + 1 - begin < least) continue;
    if (last && i + 1 - begin < least && !ends.empty()) ends.pop_back();
    ends.push_back(i + 1);
    begin = i + 1;
  }
  std::vector<Bin> out;
  begin = 0;
  for (const std::size_t end : ends) {
    out.push_back(judged(std::span(sorted).subspan(begin, end - begin)));
    begin = end;
  }
  return out;
}

}  // namespace interneuron::load
