// The picture of `bench peers`: a script for gnuplot, panel by panel.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

#include "app/process/failure.h"
#include "app/records/plot.h"
#include "lab/bench/reports.h"
#include "lab/report/figure.h"

namespace interneuron::bench {
namespace {

using peers_testbed::Row;

// Pixels.
constexpr int kNames = 150;
constexpr int kColumn = 172;
constexpr int kPanelGap = 32;
constexpr int kPeerHeight = 19;
constexpr int kTitle = 34;
constexpr int kAxis = 62;
constexpr int kKey = 34;

// Shares are drawn on a logarithmic axis, in percent; none stands at its left end.
constexpr double kNone = 0.1;
constexpr double kLeastShown = 0.14;

constexpr std::array<const char*, 3> kDeadlineColours{report::kBlue, report::kGreen,
                                                      report::kOrange};

// In the order in which they first occur.
template <class Key>
auto distinct_values(const std::vector<Row>& rows, Key key) {
  std::vector<decltype(key(rows.front()))> out;
  for (const Row& r : rows) {
    if (std::ranges::find(out, key(r)) == out.end()) out.push_back(key(r));
  }
  return out;
}

// The panels of one size: only what was run of it has a place.
struct Band {
  std::size_t bytes = 0;
  std::vector<Row> rows;
  std::vector<const peers_testbed::Scenario*> scenarios;
  std::vector<const peers_testbed::Peer*> peers;
  // By which bytes and processor time are shown.
  Duration deadline{};

  Band(std::size_t size, const std::vector<Row>& all) : bytes(size) {
    std::ranges::copy_if(all, std::back_inserter(rows),
                         [size](const Row& r) { return r.message_bytes == size; });
    scenarios = distinct_values(rows, [](const Row& r) { return r.scenario; });
    peers = distinct_values(rows, [](const Row& r) { return r.peer; });
    deadline = std::ranges::min(rows, {}, &Row::deadline).deadline;
  }

  // Misses for each scenario, then bytes, then processor time.
  std::size_t columns() const { return scenarios.size() + 2; }
  int panel_height() const { return kPeerHeight * static_cast<int>(peers.size()); }
  int height() const { return kTitle + panel_height() + kAxis; }
  std::size_t place_of(const peers_testbed::Peer* peer) const {
    return static_cast<std::size_t>(std::ranges::find(peers, peer) - peers.begin());
  }
};

// Where things are, and what there is.
struct Layout {
  std::vector<Band> bands;
  std::vector<Duration> deadlines;

  explicit Layout(const std::vector<Row>& rows)
      : deadlines(distinct_values(rows, [](const Row& r) { return r.deadline; })) {
    std::ranges::sort(deadlines);
    for (const std::size_t bytes :
         distinct_values(rows, [](const Row& r) { return r.message_bytes; })) {
      bands.emplace_back(bytes, rows);
    }
    std::ranges::sort(bands, {}, &Band::bytes);
  }

  int width() const {
    std::size_t columns = 0;
    for (const Band& band : bands) columns = std::max(columns, band.columns());
    return kNames + kColumn * static_cast<int>(columns) + kPanelGap;
  }
  int height() const { return top_of(bands.size()); }
  // Pixels above a band.
  int top_of(std::size_t band) const {
    int out = kKey;
    for (std::size_t i = 0; i < band; ++i) out += bands[i].height();
    return out;
  }
  const char* colour_of(Duration deadline) const {
    const auto place =
        static_cast<std::size_t>(std::ranges::find(deadlines, deadline) - deadlines.begin());
    return kDeadlineColours[place % kDeadlineColours.size()];
  }
};

struct Series {
  std::string colour;
  // A value and the place of its peer.
  std::vector<std::pair<double, double>> dots;
};

// What a panel says of its axis.
struct Axis {
  std::string title;
  std::string label;
  // In gnuplot's words.
  std::string range;
};

std::string panel(const Layout& l, std::size_t row, std::size_t column, const Axis& axis,
                  const std::vector<Series>& series) {
  const Band& band = l.bands[row];
  const double width = l.width();
  const double height = l.height();
  const double left = kNames + kColumn * static_cast<double>(column) + kPanelGap / 2.0;
  const double top = height - l.top_of(row) - kTitle;
  std::string out = fmt::format(
      "set lmargin at screen {:.4f}\nset rmargin at screen {:.4f}\nset tmargin at screen {:.4f}\n"
      "set bmargin at screen {:.4f}\nset title {}\nset xlabel {}\n{}\n",
      left / width, (left + kColumn - kPanelGap) / width, top / height,
      (top - band.panel_height()) / height, report::gnuplot_text(axis.title),
      report::gnuplot_text(axis.label), axis.range);
  std::string tics;
  for (std::size_t i = 0; i < band.peers.size(); ++i) {
    const std::string name = column == 0 ? std::string(band.peers[i]->name) : "";
    tics += fmt::format("{}'{}' {}", i == 0 ? "" : ", ", name, i);
  }
  out += fmt::format("set ytics ({})\n", tics);
  std::string plots;
  for (std::size_t s = 0; s < series.size(); ++s) {
    if (series[s].dots.empty()) continue;
    const std::string name = fmt::format("r{}c{}s{}", row, column, s);
    out += "$" + name + " << EOD\n";
    for (const auto& [value, place] : series[s].dots)
      out += fmt::format("{:.5g} {}\n", value, place);
    out += "EOD\n";
    plots += fmt::format("{}${} with points pt 7 ps 0.8 lc rgb '{}'",
                         plots.empty() ? "plot " : ", ", name, series[s].colour);
  }
  return out + (plots.empty() ? "plot NaN" : plots) + "\n";
}

// A little apart, so that equal ones can be told.
double place_of(const Band& band, const Row& r, std::size_t which, std::size_t of) {
  constexpr double kSpread = 0.44;
  const double step = of > 1 ? kSpread / static_cast<double>(of - 1) : 0;
  return static_cast<double>(band.place_of(r.peer)) +
         (of > 1 ? step * static_cast<double>(which) - kSpread / 2 : 0);
}

std::vector<Series> misses(const Layout& l, const Band& band,
                           const peers_testbed::Scenario* scenario) {
  std::vector<Series> out;
  for (std::size_t d = 0; d < l.deadlines.size(); ++d) {
    Series series{l.colour_of(l.deadlines[d]), {}};
    for (const Row& r : band.rows) {
      if (r.scenario != scenario || r.deadline != l.deadlines[d] || r.messages == 0) continue;
      const double share = 100 * static_cast<double>(r.missed) / static_cast<double>(r.messages);
      series.dots.emplace_back(r.missed == 0 ? kNone : std::max(kLeastShown, share),
                               place_of(band, r, d, l.deadlines.size()));
    }
    out.push_back(std::move(series));
  }
  return out;
}

// The panels of one size of messages.
std::string row_of_panels(const Layout& l, std::size_t row) {
  const Band& band = l.bands[row];
  std::vector<Series> bytes{{report::kGrey, {}}};
  std::vector<Series> time{{report::kRed, {}}, {report::kPurple, {}}};
  for (const Row& r : band.rows) {
    if (r.deadline != band.deadline) continue;
    bytes[0].dots.emplace_back(r.wire_ratio, place_of(band, r, 0, 1));
    time[0].dots.emplace_back(r.cpu_us_send, place_of(band, r, 0, 2));
    if (r.cpu_us_receive) time[1].dots.emplace_back(*r.cpu_us_receive, place_of(band, r, 1, 2));
  }
  const std::string shares = fmt::format(
      "set logscale x\nset xrange [{}:130]\nset xtics ('0' {}, '1' 1, '10' 10, '100' 100)", 0.08,
      kNone);
  // The name of the row, left of the titles of its panels.
  std::string out = fmt::format(
      "set yrange [{}:-0.6]\nset label '{} bytes' at screen {:.4f},{:.4f} right\n",
      static_cast<double>(band.peers.size()) - 0.4, band.bytes,
      static_cast<double>(kNames) / l.width(), 1 - (l.top_of(row) + kTitle * 0.5) / l.height());
  for (std::size_t s = 0; s < band.scenarios.size(); ++s) {
    out += panel(l, row, s, {std::string(band.scenarios[s]->name), "missed, %", shares},
                 misses(l, band, band.scenarios[s]));
    // Every panel draws all labels that there are; once is enough.
    out += "unset label\n";
  }
  out += panel(l, row, band.scenarios.size(),
               {"bytes", "IP bytes / payload",
                "unset logscale\nset xrange [0:*]\nset xtics autofreq\nset format x '%g'"},
               bytes);
  return out +
         panel(l, row, band.scenarios.size() + 1,
               {"processor", "us / message",
                "set logscale x\nset xrange [*:*]\nset xtics autofreq\nset format x '%.0s%c'"},
               time);
}

// What the colours mean, in a line above all panels.
std::string key(const Layout& l) {
  std::vector<std::pair<std::string, std::string>> entries;
  for (const Duration d : l.deadlines) {
    entries.emplace_back(fmt::format("missed by {:.0f} ms", to_ms(d)), l.colour_of(d));
  }
  entries.emplace_back("to send", report::kRed);
  entries.emplace_back("to receive", report::kPurple);
  std::string out;
  double at = kNames + kPanelGap;
  for (const auto& [text, colour] : entries) {
    constexpr double kEntryGap = 34;
    constexpr double kLetter = 8;
    out += fmt::format(
        "set label '{}' at screen {:.4f},{:.4f} left point pt 7 lc rgb '{}' offset 0.7,0\n", text,
        at / l.width(), 1 - 0.5 * kKey / l.height(), colour);
    at += kEntryGap + kLetter * static_cast<double>(text.size());
  }
  return out;
}

}  // namespace

void plot_peers(const std::filesystem::path& file, const std::vector<Row>& rows) {
  const Layout l(rows);
  const bool svg = file.extension() == ".svg";
  std::string script = fmt::format(
      "set terminal {} size {},{} noenhanced font 'sans{},11' background rgb 'white'\n"
      "set border 3\nset tics nomirror out\n"
      "set grid xtics ytics lc rgb '#70888888'\nunset key\nset multiplot\n",
      svg ? "svg" : "pngcairo", l.width(), l.height(), svg ? "-serif" : "");
  script += key(l);
  for (std::size_t row = 0; row < l.bands.size(); ++row) script += row_of_panels(l, row);
  if (!records::draw(file, script + "unset multiplot\n")) {
    throw process::Failure(process::kFailed,
                           "--plot needs gnuplot; install the package gnuplot-nox");
  }
}

}  // namespace interneuron::bench
