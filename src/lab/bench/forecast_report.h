// What `bench forecast` shows of its bins: JSON (docs/schema/forecast.json), tables and a picture.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "app/records/json_file.h"
#include "lab/load/forecast.h"

namespace interneuron::cli {

inline constexpr const char* kForecastSchema = "interneuron.forecast/2";

// The predictions of a scenario, or of several together.
struct Judged {
  std::string scenario;
  std::vector<load::Bin> bins;
  double brier = 0;
  std::size_t messages = 0;
};

records::Json forecast_json(const std::vector<Judged>& judged, std::uint64_t first_seed,
                            std::uint64_t seeds);
// A table for each, on stdout.
void print_forecast(const std::vector<Judged>& judged);
// What happened against what was predicted, a panel for each, with three standard errors. Throws
// Failure (1) that names the file, also without gnuplot.
void plot_forecast(const std::filesystem::path& file, const std::vector<Judged>& judged);

}  // namespace interneuron::cli
