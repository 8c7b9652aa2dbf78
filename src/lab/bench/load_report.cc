#include "lab/bench/reports.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "app/process/failure.h"
#include "app/records/plot.h"
#include "lab/report/figure.h"

namespace interneuron::bench {
namespace {

using load::Row;

records::Json known(const std::optional<double>& value) {
  return value ? records::Json(records::rounded(*value)) : records::Json(nullptr);
}

records::Json row_json(const Row& r) {
  const load::Scenario& s = r.scenario;
  return {{"group", s.group},
          {"scenario", s.name},
          {"peer", load::name_of(s.peer)},
          {"load", records::rounded(s.load)},
          {"vehicles", s.vehicles},
          {"capacity_mbit", records::rounded(s.capacity.mbit())},
          {"queue_ms", to_ms(s.queue)},
          {"codel", s.codel},
          {"l4s", s.l4s},
          {"message_bytes", s.message_bytes},
          {"deadline_ms", to_ms(s.deadline)},
          {"messages", r.messages},
          {"missed", r.missed},
          {"degraded", r.degraded},
          {"age_p50_ms", records::rounded(r.age_p50_ms)},
          {"age_p99_ms", records::rounded(r.age_p99_ms)},
          {"on_time_goodput_mbit", records::rounded(r.on_time_goodput_mbit)},
          {"of_possible", records::rounded(r.of_possible)},
          {"queue_p99_ms", records::rounded(r.queue_p99_ms)},
          {"utilisation", records::rounded(r.utilisation)},
          {"jain", known(r.jain)},
          {"early_missed_percent", known(r.early_missed_percent)},
          {"later_missed_percent", known(r.later_missed_percent)},
          {"joining_queue_p99_ms", known(r.joining_queue_p99_ms)},
          {"whole_after_ms", known(r.whole_after_ms)},
          {"share_after_ms", known(r.share_after_ms)},
          {"own_share", known(r.own_share)},
          {"cross_share", known(r.cross_share)},
          {"cross", s.cross_flows == 0 ? records::Json(nullptr)
                                       : records::Json(s.is_cross_bbr ? "bbr" : "cubic")},
          {"road_cpu_percent", known(r.road_cpu_percent)},
          {"seed", s.seed},
          {"encrypted", s.is_encrypted},
          {"together", !s.is_spread}};
}

std::string number(const std::optional<double>& value, int decimals) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : "–";
}

// What only some groups have.
struct Extra {
  const char* title;
  const char* unit;
  std::optional<double> Row::*value;
  int decimals;
};
constexpr std::array kExtras{
    Extra{"Jain", "", &Row::jain, 3},
    Extra{"missed first", "%", &Row::early_missed_percent, 1},
    Extra{"missed then", "%", &Row::later_missed_percent, 1},
    Extra{"queue first", "ms", &Row::joining_queue_p99_ms, 0},
    Extra{"share after", "ms", &Row::share_after_ms, 0},
    Extra{"own share", "", &Row::own_share, 2},
    Extra{"cross share", "", &Row::cross_share, 2},
    Extra{"whole after", "ms", &Row::whole_after_ms, 0},
    Extra{"road's CPU", "%", &Row::road_cpu_percent, 1},
};

// Those that any of the rows has.
std::vector<Extra> extras_of(const std::vector<const Row*>& rows) {
  std::vector<Extra> out;
  for (const Extra& extra : kExtras) {
    const auto has = [&extra](const Row* r) { return (r->*extra.value).has_value(); };
    if (std::ranges::any_of(rows, has)) out.push_back(extra);
  }
  return out;
}

void print_head(const load::Group& group, const std::vector<Extra>& extras) {
  fmt::print("\n{}: {}\n", group.name, group.about);
  const auto line = [](auto... cells) {
    fmt::print("{:<16}{:<15}{:>5}{:>10}{:>8}{:>8}{:>9}{:>9}{:>9}{:>11}{:>7}", cells...);
  };
  line("scenario", "peer", "load", "messages", "missed", "degr.", "on time", "of poss.", "age p99",
       "queue p99", "util.");
  for (const Extra& extra : extras) fmt::print("{:>13}", extra.title);
  fmt::print("\n");
  line("", "", "", "", "", "", "Mbit/s", "%", "ms", "ms", "%");
  for (const Extra& extra : extras) fmt::print("{:>13}", extra.unit);
  fmt::print("\n");
}

void print_row(const Row& r, const std::vector<Extra>& extras) {
  const load::Scenario& s = r.scenario;
  fmt::print("{:<16}{:<15}{:>5.2f}{:>10}{:>8}{:>8}{:>9.2f}{:>9.1f}{:>9.1f}{:>11.1f}{:>7.0f}",
             s.name, load::name_of(s.peer), s.load, r.messages, r.missed, r.degraded,
             r.on_time_goodput_mbit, 100 * r.of_possible, r.age_p99_ms, r.queue_p99_ms,
             100 * r.utilisation);
  for (const Extra& extra : extras) {
    fmt::print("{:>13}", number(r.*extra.value, extra.decimals));
  }
  fmt::print("\n");
}

bool raises_load(const Row& r) { return r.scenario.group == "rate" || r.scenario.group == "size"; }

std::string column_of(const Row& r) { return r.scenario.group + " " + r.scenario.name; }

// The colours of ours and of the others, by Peer.
constexpr std::array<const char*, load::kPeers> kColours{
    report::kBlue,   report::kGreen,  report::kGrey, report::kOrange, report::kRed,
    report::kPurple, report::kOrange, report::kRed,  report::kPurple};

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

// What the messages could have come to: all that is offered, or all that the bottleneck carries.
double possible_mbit(const load::Scenario& s) {
  return std::min(s.load, 1.0) * s.capacity.mbit() * load::payload_share(s.message_bytes);
}

template <class Value>
std::string block(const std::string& name, const std::vector<const Row*>& rows, Value value) {
  std::string out = "$" + name + " << EOD\n";
  for (const Row* r : rows) out += fmt::format("{:.4f} {:.4f}\n", r->scenario.load, value(*r));
  return out + "EOD\n";
}

// One panel: a line for each transport; with goodput, the best there could be as a dashed line.
std::string curves(const std::vector<Row>& rows, const std::string& column, bool queue) {
  std::string blocks;
  std::string plots;
  for (const load::Peer peer : distinct(rows, [](const Row& r) { return r.scenario.peer; })) {
    std::vector<const Row*> line;
    for (const Row& r : rows) {
      const bool is_here = raises_load(r) && column_of(r) == column && r.scenario.peer == peer;
      if (is_here) line.push_back(&r);
    }
    if (!queue && blocks.empty()) {
      blocks += block("possible", line, [](const Row& r) { return possible_mbit(r.scenario); });
      plots += "plot $possible with lines dt 2 lw 1.5 lc rgb 'black'";
    }
    const std::string name = fmt::format("line{}", static_cast<std::size_t>(peer));
    blocks += block(name, line, [queue](const Row& r) {
      return queue ? r.queue_p99_ms : r.on_time_goodput_mbit;
    });
    plots +=
        fmt::format("{}${} with linespoints pt 7 ps 0.6 lw 2 lc rgb '{}'",
                    plots.empty() ? "plot " : ", ", name, kColours[static_cast<std::size_t>(peer)]);
  }
  return blocks + plots + "\n";
}

// Pixels.
constexpr int kColumnWidth = 330;
constexpr int kMargins = 90;
constexpr int kHeight = 640;
constexpr double kLeftMargin = 75;
constexpr double kGap = 50;
constexpr double kKeyGap = 32;
constexpr double kLetter = 8;

int width_of(std::size_t columns) { return kColumnWidth * static_cast<int>(columns) + kMargins; }

// The key as labels in a row above all panels: one of gnuplot's own would be as wide as a panel.
std::string key(const std::vector<Row>& rows, std::size_t columns) {
  std::string out;
  double at = kKeyGap / 2;
  for (const load::Peer peer : distinct(rows, [](const Row& r) { return r.scenario.peer; })) {
    out += fmt::format(
        "set label '{}' at screen {:.4f},0.965 left point pt 7 lc rgb '{}' offset 0.7,0\n",
        load::name_of(peer), at / width_of(columns), kColours[static_cast<std::size_t>(peer)]);
    at += kKeyGap + kLetter * static_cast<double>(load::name_of(peer).size());
  }
  return out + fmt::format("set label '- - possible' at screen {:.4f},0.965 left\n",
                           at / width_of(columns));
}

std::string script(const std::vector<Row>& rows, std::size_t columns) {
  const auto names = distinct(rows, column_of);
  std::string out = fmt::format(
      "set border 3\nset tics nomirror out\nset grid xtics ytics lc rgb '#70888888'\n"
      "unset key\nset multiplot layout 2,{} columnsfirst margins screen {:.4f},0.985,0.09,0.88 "
      "spacing "
      "screen {:.4f},0.1\n",
      columns, kLeftMargin / width_of(columns), kGap / width_of(columns));
  out += key(rows, columns);
  for (std::size_t i = 0; i < names.size(); ++i) {
    out += fmt::format("set title {}\nset xlabel ''\nset ylabel '{}'\nset yrange [0:*]\n",
                       report::gnuplot_text(names[i]), i == 0 ? "on-time goodput, Mbit/s" : "");
    out += curves(rows, names[i], false) + "set title ''\n";
    out +=
        fmt::format("set xlabel 'offered load'\nset ylabel '{}'\n", i == 0 ? "queue p99, ms" : "");
    out += curves(rows, names[i], true);
    out += "unset label\n";
  }
  return out + "unset multiplot\n";
}

}  // namespace

records::Json load_json(const std::vector<Row>& rows, std::optional<TransportKind> datagrams) {
  records::Json out{{"schema", kLoadSchema},
                    {"mode", datagrams ? "testbed" : "sim"},
                    {"rows", records::Json::array()}};
  if (datagrams) out["transport"] = to_string(*datagrams);
  for (const Row& r : rows) out["rows"].push_back(row_json(r));
  return out;
}

void print_load(const std::vector<Row>& rows) {
  for (const load::Group& group : load::groups()) {
    std::vector<const Row*> of_group;
    for (const Row& r : rows) {
      if (r.scenario.group == group.name) of_group.push_back(&r);
    }
    if (of_group.empty()) continue;
    const std::vector<Extra> extras = extras_of(of_group);
    print_head(group, extras);
    for (const Row* r : of_group) print_row(*r, extras);
  }
}

void require_picture(const std::string& plot) {
  const std::filesystem::path extension = std::filesystem::path(plot).extension();
  if (plot.empty() || extension == ".svg" || extension == ".png") return;
  throw process::Failure(process::kUsage,
                         "--plot '" + plot + "': name a file that ends in .svg or .png");
}

void plot_load(const std::filesystem::path& file, const std::vector<Row>& rows) {
  const std::size_t columns = distinct(rows, column_of).size();
  const bool svg = file.extension() == ".svg";
  const std::string head =
      fmt::format("set terminal {} size {},{} noenhanced font 'sans{},11' background rgb 'white'\n",
                  svg ? "svg" : "pngcairo", width_of(columns), kHeight, svg ? "-serif" : "");
  if (!records::draw(file, head + script(rows, columns))) {
    throw process::Failure(process::kFailed,
                           "--plot needs gnuplot; install the package gnuplot-nox");
  }
}

}  // namespace interneuron::bench
