#include "app/cli/bench/load_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "host/process/failure.h"
#include "lab/files/run_files.h"
#include "lab/report/figure.h"

namespace interneuron::cli {
namespace {

using load::Row;

double rounded(double v) { return std::round(v * 1000.0) / 1000.0; }

lab::Json known(const std::optional<double>& value) {
  return value ? lab::Json(rounded(*value)) : lab::Json(nullptr);
}

lab::Json row_json(const Row& r) {
  const load::Scenario& s = r.scenario;
  return {{"group", s.group},
          {"scenario", s.name},
          {"peer", load::name_of(s.peer)},
          {"load", rounded(s.load)},
          {"vehicles", s.vehicles},
          {"capacity_mbit", rounded(s.capacity.mbit())},
          {"queue_ms", to_ms(s.queue)},
          {"message_bytes", s.message_bytes},
          {"deadline_ms", to_ms(s.deadline)},
          {"messages", r.messages},
          {"missed", r.missed},
          {"degraded", r.degraded},
          {"age_p50_ms", rounded(r.age_p50_ms)},
          {"age_p99_ms", rounded(r.age_p99_ms)},
          {"on_time_goodput_mbit", rounded(r.on_time_goodput_mbit)},
          {"of_possible", rounded(r.of_possible)},
          {"queue_p99_ms", rounded(r.queue_p99_ms)},
          {"utilisation", rounded(r.utilisation)},
          {"jain", known(r.jain)},
          {"whole_after_ms", known(r.whole_after_ms)},
          {"seed", s.seed}};
}

std::string number(const std::optional<double>& value, int decimals) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : "–";
}

void print_head(const load::Group& group) {
  fmt::print("\n{}: {}\n", group.name, group.about);
  fmt::print("{:<20}{:<14}{:>6}{:>10}{:>8}{:>8}{:>9}{:>9}{:>10}{:>11}{:>7}{:>7}{:>13}\n",
             "scenario", "peer", "load", "messages", "missed", "degr.", "on time", "of poss.",
             "age p99", "queue p99", "util.", "Jain", "whole after");
  fmt::print("{:<20}{:<14}{:>6}{:>10}{:>8}{:>8}{:>9}{:>9}{:>10}{:>11}{:>7}{:>7}{:>13}\n", "", "",
             "", "", "", "", "Mbit/s", "%", "ms", "ms", "%", "", "ms");
}

void print_row(const Row& r) {
  const load::Scenario& s = r.scenario;
  fmt::print(
      "{:<20}{:<14}{:>6.2f}{:>10}{:>8}{:>8}{:>9.2f}{:>9.1f}{:>10.1f}{:>11.1f}{:>7.0f}"
      "{:>7}{:>13}\n",
      s.name, load::name_of(s.peer), s.load, r.messages, r.missed, r.degraded,
      r.on_time_goodput_mbit, 100 * r.of_possible, r.age_p99_ms, r.queue_p99_ms,
      100 * r.utilisation, number(r.jain, 3), number(r.whole_after_ms, 0));
}

bool raises_load(const Row& r) { return r.scenario.group == "rate" || r.scenario.group == "size"; }

std::string column_of(const Row& r) { return r.scenario.group + " " + r.scenario.name; }

// Of ours and of the others, by Peer.
constexpr std::array kColours{report::kBlue,   report::kGreen, report::kGrey,
                              report::kOrange, report::kRed,   report::kPurple};

// In the order in which they first occur.
template <class Key>
auto distinct(const std::vector<Row>& rows, Key key) {
  std::vector<decltype(key(rows.front()))> out;
  for (const Row& r : rows) {
    if (!raises_load(r)) continue;
    if (std::ranges::find(out, key(r)) == out.end()) out.push_back(key(r));
  }
  return out;
}

std::string curves(const std::vector<Row>& rows, const std::string& column, bool queue,
                   bool with_key) {
  std::string blocks;
  std::string plots;
  for (const load::Peer peer : distinct(rows, [](const Row& r) { return r.scenario.peer; })) {
    const std::string name = fmt::format("{}{}", queue ? "q" : "g", static_cast<std::size_t>(peer));
    blocks += "$" + name + " << EOD\n";
    for (const Row& r : rows) {
      if (!raises_load(r) || column_of(r) != column || r.scenario.peer != peer) continue;
      blocks += fmt::format("{:.4f} {:.4f}\n", r.scenario.load,
                            queue ? r.queue_p99_ms : 100 * r.of_possible);
    }
    blocks += "EOD\n";
    plots += fmt::format("{}${} with linespoints pt 7 ps 0.6 lw 2 lc rgb '{}' {}",
                         plots.empty() ? "plot " : ", ", name,
                         kColours[static_cast<std::size_t>(peer) % kColours.size()],
                         with_key ? fmt::format("title '{}'", load::name_of(peer)) : "notitle");
  }
  return blocks + plots + "\n";
}

// Pixels.
constexpr int kColumnWidth = 330;
constexpr int kHeight = 640;

std::string script(const std::vector<Row>& rows, std::size_t columns) {
  const auto names = distinct(rows, column_of);
  std::string out =
      "set border 3\nset tics nomirror out\nset grid xtics ytics lc rgb '#70888888'\n"
      "set key bottom left samplen 1\n";
  out += fmt::format("set multiplot layout 2,{} columnsfirst\n", columns);
  for (std::size_t i = 0; i < names.size(); ++i) {
    out +=
        fmt::format("set title {}\nset xlabel ''\nset ylabel '{}'\nset yrange [0:105]\n",
                    report::gnuplot_text(names[i]), i == 0 ? "on-time payload, % of possible" : "");
    out += "set xrange [*:*]\n" + curves(rows, names[i], false, i == 0);
    out += fmt::format(
        "set title ''\nset xlabel 'offered load'\nset ylabel '{}'\nset yrange "
        "[0:*]\n",
        i == 0 ? "queue p99, ms" : "");
    out += curves(rows, names[i], true, false);
  }
  return out + "unset multiplot\n";
}

}  // namespace

lab::Json load_json(const std::vector<Row>& rows) {
  lab::Json out{{"schema", kLoadSchema}, {"rows", lab::Json::array()}};
  for (const Row& r : rows) out["rows"].push_back(row_json(r));
  return out;
}

void print_load(const std::vector<Row>& rows) {
  for (const load::Group& group : load::groups()) {
    bool first = true;
    for (const Row& r : rows) {
      if (r.scenario.group != group.name) continue;
      if (first) print_head(group);
      first = false;
      print_row(r);
    }
  }
}

bool is_picture(const std::filesystem::path& file) {
  return file.extension() == ".svg" || file.extension() == ".png";
}

void plot_load(const std::filesystem::path& file, const std::vector<Row>& rows) {
  const std::size_t columns = distinct(rows, column_of).size();
  const bool svg = file.extension() == ".svg";
  const std::string head = fmt::format(
      "set terminal {} size {},{} noenhanced font 'sans{},11' background rgb 'white'\n"
      "set output {}\n",
      svg ? "svg" : "pngcairo", kColumnWidth * static_cast<int>(columns), kHeight,
      svg ? "-serif" : "", report::gnuplot_text(file.string()));
  if (!lab::draw(file, head + script(rows, columns))) {
    throw Failure(kFailed, "--plot needs gnuplot; install the package gnuplot-nox");
  }
}

}  // namespace interneuron::cli
