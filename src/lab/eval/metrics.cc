#include "lab/eval/metrics.h"

#include <algorithm>

#include "core/base/statistics.h"

namespace interneuron::eval {

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
