// Plots by gnuplot, and that of the end-to-end time per round with the marks of the paper's Fig.
// rt_guarantee.
#include "app/records/plot.h"

#include <fmt/format.h>

#include <cerrno>
#include <csignal>
#include <string_view>

#include "app/process/child.h"
#include "app/process/failure.h"
#include "app/process/whole_file.h"
#include "app/records/run_files.h"

namespace interneuron::records {
namespace {

// '+' in the figure: θ1 ≫ D1. Here: later by more than a fifth of the end-to-end deadline.
constexpr int kFarLateDivisor = 5;
// U+2019, which people read as a quote and gnuplot does not. Its own way to write one, twice, does
// not work at the beginning of a string: there two are an empty string, and the rest is a command.
constexpr std::string_view kApostrophe = "\u2019";

struct Point {
  std::uint32_t round;
  double e2e_ms;
};

std::string data_block(const std::string& name, const std::vector<Point>& points) {
  std::string out = "$" + name + " << EOD\n";
  for (const Point& p : points) out += fmt::format("{} {:.3f}\n", p.round, p.e2e_ms);
  return out + "EOD\n";
}

std::string script(const std::vector<RoundRow>& rows, const Json& summary) {
  std::vector<Point> remote, local, at_d1, missed, far;
  const double deadline = summary["deadline_ms"].get<double>();
  for (const RoundRow& r : rows) {
    const Point p{r.round, to_ms(r.e2e)};
    (r.outcome == Outcome::kRemote ? remote : local).push_back(p);
    if (!r.road) continue;
    if (r.road->released) at_d1.push_back(p);
    if (r.road->late && to_ms(r.road->overrun) > deadline / kFarLateDivisor) {
      far.push_back(p);
    } else if (r.road->late || r.degraded_final) {
      missed.push_back(p);
    }
  }
  const std::vector<std::pair<std::string, const std::vector<Point>*>> blocks{
      {"remote", &remote}, {"local", &local}, {"atd1", &at_d1}, {"missed", &missed}, {"far", &far}};
  std::string s;
  for (const auto& [name, points] : blocks) s += data_block(name, *points);
  const std::string seed = summary["seed"].is_null()
                               ? ""
                               : fmt::format(", seed {}", summary["seed"].get<std::uint64_t>());
  const auto first = rows.empty() ? 0 : std::int64_t{rows.front().round};
  const auto last = rows.empty() ? 0 : std::int64_t{rows.back().round};
  s += fmt::format(
      "set terminal pngcairo size 1100,480 font 'sans,11' background rgb 'white'\n"
      "set title 'End-to-end time per round: {} of {} on time{}'\n"
      "set xlabel 'round'\nset ylabel 'end-to-end time, ms'\n"
      "set yrange [0:{}]\nset xrange [{}:{}]\n"
      "set key outside below maxrows 2 samplen 2\nset border 3\nset tics nomirror out\n"
      "set grid ytics lc rgb '#dddddd'\n"
      "set arrow from graph 0, first {} to graph 1, first {} nohead dt 2 lw 1.5 lc rgb '#b00020'\n",
      summary["on_time"].get<std::size_t>(), summary["rounds"].get<std::size_t>(), seed,
      deadline * 1.15, first - 1, last + 1, deadline, deadline);
  s += fmt::format(
      "set label 'D_N = {:.0f} ms' at graph 0.005, first {} offset 0,0.7 tc rgb '#b00020'\n",
      deadline, deadline);
  s += "plot $remote with lines lc rgb '#9db7d5' notitle, "
       "$remote with points pt 7 ps 0.5 lc rgb '#2f6db3' title 'on time (remote)', ";
  if (!local.empty())
    s += "$local with points pt 9 ps 1.1 lc rgb '#b00020' title 'answered locally', ";
  if (!at_d1.empty()) {
    s += "$atd1 with points pt 7 ps 1.0 lc rgb '#222222' notitle, "
         "$atd1 with points pt 7 ps 0.7 lc rgb 'white' title 'θ_1 = D_1 (sampled image used)', ";
  }
  if (!missed.empty()) {
    s += "$missed with points pt 2 ps 1.0 lw 1.6 lc rgb '#e08a00' title 'θ_1 > D_1 or θ_2 > D_2', ";
  }
  if (!far.empty()) s += "$far with points pt 1 ps 1.2 lw 1.8 lc rgb '#7b3fa0' title 'θ_1 ≫ D_1', ";
  s += "NaN with lines dt 2 lw 1.5 lc rgb '#b00020' title 'deadline'\n";
  return s;
}

}  // namespace

std::string gnuplot_text(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    const bool control = (static_cast<unsigned char>(c) < ' ') || c == '\x7f';
    if (c == '\'') {
      out += kApostrophe;
    } else {
      out += control ? ' ' : c;
    }
  }
  return out + "'";
}

std::string picture_of(const std::filesystem::path& file, const std::string& gnuplot_script) {
  // -d: what the user's own start-up file says has no place in our pictures.
  const process::Filtered drawn = process::filter(gnuplot_script, {"gnuplot", "-d", "-"});
  if (drawn.start_error == ENOENT) {
    fmt::print(stderr, "no plot: gnuplot is not installed; install the package gnuplot-nox\n");
    return {};
  }
  if (drawn.start_error != 0) {
    throw process::Failure(process::kFailed,
                           process::file_problem("cannot run", "gnuplot", drawn.start_error));
  }
  // A terminal's Ctrl-C reaches gnuplot, too.
  if (drawn.code == 128 + SIGINT || drawn.code == 128 + SIGTERM) {
    throw process::Failure(drawn.code, "interrupted");
  }
  if (drawn.code == process::kFine && !drawn.output.empty()) return drawn.output;
  throw process::Failure(process::kFailed, "gnuplot could not draw '" + file.string() + "'");
}

bool draw(const std::filesystem::path& file, const std::string& gnuplot_script) {
  const std::string picture = picture_of(file, gnuplot_script);
  if (!picture.empty()) process::write_whole(file, picture);
  return !picture.empty();
}

bool plot_latency(const std::filesystem::path& file, const std::vector<RoundRow>& rows,
                  const Json& summary) {
  return draw(file, script(rows, summary));
}

}  // namespace interneuron::records
