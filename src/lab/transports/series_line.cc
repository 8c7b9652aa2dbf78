#include "lab/transports/series_line.h"

#include <fmt/format.h>

#include <cstdio>
#include <numeric>

namespace interneuron::transports {

SeriesLine::SeriesLine(std::string series, std::vector<Duration> times)
    : series_(std::move(series)), times_(std::move(times)) {}

void SeriesLine::next(const std::string& run) {
  const auto rest = times_.begin() + static_cast<std::ptrdiff_t>(begun_);
  const Duration left = std::accumulate(rest, times_.end(), Duration{});
  run_ = run;
  ++begun_;
  const std::string text = fmt::format("{}: run {} of {}: {}, {:.0f} s left", series_, begun_,
                                       times_.size(), run_, to_ms(left) / 1e3);
  if (line_.live()) {
    line_.show(text);
  } else {
    fmt::print(stderr, "{}\n", text);
  }
}

void SeriesLine::doubt(const std::string& reason) {
  if (reason.empty()) return;
  line_.clear();
  fmt::print(stderr, "interneuron: doubtful: {}: {}\n", run_, reason);
}

}  // namespace interneuron::transports
