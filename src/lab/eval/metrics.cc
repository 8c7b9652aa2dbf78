#include "lab/eval/metrics.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace interneuron::eval {
namespace {

double mean(const std::vector<double>& values) {
  if (values.empty()) return 0;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace

double percentile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  const auto rank =
      static_cast<std::size_t>(std::max(1.0, std::ceil(q * static_cast<double>(values.size()))));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(rank - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

std::array<double, 2> wilson95(std::uint64_t hits, std::uint64_t n) {
  if (n == 0) return {0, 1};
  constexpr double z = 1.959964;  // of the normal, 95 % two-sided
  const auto count = static_cast<double>(n);
  const double p = static_cast<double>(hits) / count;
  const double scale = 1 + z * z / count;
  const double middle = (p + z * z / (2 * count)) / scale;
  const double half = z * std::sqrt(p * (1 - p) / count + z * z / (4 * count * count)) / scale;
  return {hits == 0 ? 0 : middle - half, hits == n ? 1 : middle + half};
}

Figures figures(std::span<const Run> runs, const Profile& profile) {
  Figures out;
  std::vector<double> e2e;
  std::vector<double> on_time;
  std::vector<double> all;
  for (const Run& run : runs) {
    bool missed = false;
    for (const Round& round : run.rounds) {
      all.push_back(quality_of(profile, round.shown));
      if (round.on_time) {
        e2e.push_back(to_ms(round.e2e));
        on_time.push_back(all.back());
      } else if (missed) {
        ++out.consecutive;
      }
      missed = !round.on_time;
    }
    out.bytes_per_round.resize(std::max(out.bytes_per_round.size(), run.bytes_up.size()));
    for (std::size_t i = 0; i < run.bytes_up.size(); ++i) {
      out.bytes_per_round[i] += static_cast<double>(run.bytes_up[i] + run.bytes_down[i]);
    }
  }
  out.rounds = all.size();
  out.timeouts = out.rounds - e2e.size();
  out.timeouts_ci95 = wilson95(out.timeouts, out.rounds);
  out.e2e_mean_ms = mean(e2e);
  out.e2e_p50_ms = percentile(e2e, 0.50);
  out.e2e_p95_ms = percentile(e2e, 0.95);
  out.e2e_p99_ms = percentile(e2e, 0.99);
  out.quality = mean(all);
  out.quality_on_time = mean(on_time);
  for (double& bytes : out.bytes_per_round) bytes /= std::max(1.0, static_cast<double>(out.rounds));
  return out;
}

}  // namespace interneuron::eval
