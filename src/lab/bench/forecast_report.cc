#include "lab/bench/reports.h"

#include <fmt/format.h>

#include "app/process/failure.h"
#include "app/records/plot.h"
#include "lab/report/figure.h"

namespace interneuron::bench {
namespace {

// Pixels of a panel.
constexpr int kWidth = 330;
constexpr int kForecastHeight = 360;
constexpr std::size_t kColumns = 3;

const char* verdict(const load::Bin& bin) {
  if (bin.messages < load::kLeastInBin) return "too few";
  return bin.kept() ? "kept" : "broken";
}

std::string panel(const Judged& j, std::size_t number) {
  std::string out = fmt::format("$bins{} << EOD\n", number);
  for (const load::Bin& b : j.bins) {
    out += fmt::format("{:.4f} {:.4f} {:.4f}\n", b.predicted, b.happened, 3 * b.standard_error);
  }
  return out + fmt::format(
                   "EOD\nset title {}\nplot x with lines dt 2 lc rgb 'black', $bins{} with "
                   "yerrorbars pt 7 ps 0.6 lc rgb '{}'\n",
                   report::gnuplot_text(j.scenario), number, report::kBlue);
}

}  // namespace

records::Json forecast_json(const std::vector<Judged>& judged, std::uint64_t first_seed,
                            std::uint64_t seeds) {
  records::Json out{{"schema", kForecastSchema},
                    {"first_seed", first_seed},
                    {"seeds", seeds},
                    {"scores", records::Json::array()},
                    {"rows", records::Json::array()}};
  for (const Judged& j : judged) {
    out["scores"].push_back({{"scenario", j.scenario},
                             {"brier", records::rounded(j.brier, 1e4)},
                             {"messages", j.messages}});
    for (const load::Bin& b : j.bins) {
      out["rows"].push_back({{"scenario", j.scenario},
                             {"predicted", records::rounded(b.predicted, 1e4)},
                             {"happened", records::rounded(b.happened, 1e4)},
                             {"messages", b.messages},
                             {"standard_error", records::rounded(b.standard_error, 1e4)},
                             {"verdict", verdict(b)}});
    }
  }
  return out;
}

void print_forecast(const std::vector<Judged>& judged) {
  for (const Judged& j : judged) {
    fmt::print("\n{}: Brier score {:.4f}\n{:>10}{:>10}{:>8}{:>8}{:>10}  {}\n", j.scenario, j.brier,
               "predicted", "happened", "gap", "error", "messages", "verdict");
    for (const load::Bin& b : j.bins) {
      fmt::print("{:>10.3f}{:>10.3f}{:>+8.3f}{:>8.3f}{:>10}  {}\n", b.predicted, b.happened,
                 b.gap(), b.standard_error, b.messages, verdict(b));
    }
  }
}

void plot_forecast(const std::filesystem::path& file, const std::vector<Judged>& judged) {
  const std::size_t columns = std::min(kColumns, judged.size());
  const std::size_t lines = (judged.size() + columns - 1) / columns;
  const bool svg = file.extension() == ".svg";
  std::string script = fmt::format(
      "set terminal {} size {},{} noenhanced font 'sans{},11' background rgb 'white'\n"
      "set multiplot layout {},{}\nset xrange [0:1]\nset yrange [0:1]\n"
      "set size square\nset grid lc rgb '#70888888'\nunset key\n"
      "set xlabel 'predicted'\nset ylabel 'on time'\n",
      svg ? "svg" : "pngcairo", kWidth * static_cast<int>(columns),
      kForecastHeight * static_cast<int>(lines), svg ? "-serif" : "", lines, columns);
  for (std::size_t i = 0; i < judged.size(); ++i) script += panel(judged[i], i);
  if (!records::draw(file, script + "unset multiplot\n")) {
    throw process::Failure(process::kFailed,
                           "--plot needs gnuplot; install the package gnuplot-nox");
  }
}

}  // namespace interneuron::bench
