// Systems side by side: timeouts and what was got, with intervals.
#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>

#include "lab/eval/experiments/document.h"
#include "lab/report/figure.h"

namespace interneuron::report {
namespace {

using experiments::LadderRow;
using experiments::SystemRow;
using experiments::Table;

template <class Row>
const char* colour_of(const Row& row) {
  if (row.name == "oracle" || row.name == "causal" || row.name == "causal_player") return kGreen;
  return row.baseline ? kOrange : kBlue;
}

// An axis that ends at 1 has these tics, so that its numbers stay apart.
constexpr double kWideTics = 0.25;

Dot dot(double value) { return {value, value, value}; }

Dot share_missed(const SystemRow& r) {
  return {100 * r.timeouts_share, 100 * r.timeouts_ci95[0], 100 * r.timeouts_ci95[1]};
}

std::optional<Dot> quality(const SystemRow& r) { return dot(r.quality); }

std::optional<Dot> effective_agreement(const SystemRow& r) {
  if (!r.agreement || !r.agreement->effective) return std::nullopt;
  return dot(*r.agreement->effective);
}

Dot dot(const eval::Paired& p) {
  return p.ci95 ? Dot{p.mean, (*p.ci95)[0], (*p.ci95)[1]} : dot(p.mean);
}

// One series per colour, so that the key tells them apart.
template <class Row>
std::vector<Dots> by_kind(const std::vector<Row>& rows,
                          const std::function<std::optional<Dot>(const Row&)>& value) {
  std::vector<Dots> out{{"ours", kBlue, {}}, {"baselines", kOrange, {}}, {"bounds", kGreen, {}}};
  for (Dots& series : out) {
    for (const Row& row : rows) {
      series.dots.push_back(series.colour == colour_of(row) ? value(row) : std::nullopt);
    }
  }
  return out;
}

template <class Row>
Figure dots_of(const Document& document, const Table& table, const std::vector<Row>& rows,
               const std::string& caption, const std::vector<Panel>& panels) {
  std::vector<std::string> names;
  for (const Row& row : rows) names.push_back(row.name);
  return {.name = document.experiment + "-" + table.name,
          .caption = table.title + caption,
          .height = dots_height(names.size()),
          .script = dot_panels(names, panels)};
}

Figure of_systems(const Document& document, const Table& table,
                  const std::vector<SystemRow>& rows) {
  std::vector<Panel> panels{{"rounds missed, %", by_kind<SystemRow>(rows, share_missed)}};
  if (std::ranges::any_of(rows, [](const SystemRow& r) { return r.effective_ap.has_value(); })) {
    panels.push_back({"effective AP", by_kind<SystemRow>(rows, [](const SystemRow& r) {
                        return r.effective_ap ? std::optional(dot(*r.effective_ap)) : std::nullopt;
                      })});
  }
  if (std::ranges::any_of(rows,
                          [](const SystemRow& r) { return effective_agreement(r).has_value(); })) {
    panels.push_back({.title = "effective agreement",
                      .series = by_kind<SystemRow>(rows, effective_agreement),
                      .tics = kWideTics});
  }
  const bool is_wide = std::ranges::any_of(rows, [](const auto& r) { return r.quality > 0.5; });
  panels.push_back({.title = "quality",
                    .series = by_kind<SystemRow>(rows, quality),
                    .tics = is_wide ? kWideTics : 0});
  return dots_of(document, table, rows,
                 ": rounds missed (95 % intervals) and what the application really got", panels);
}

Figure of_ladder(const Document& document, const Table& table) {
  const auto& rows = experiments::rows_as<LadderRow>(table);
  return dots_of(
      document, table, rows, "",
      {{"timeouts more than ours, of 300",
        by_kind<LadderRow>(rows, [](const LadderRow& r) { return dot(r.more_timeouts_per_300); }),
        false, true},
       {"quality more than ours",
        by_kind<LadderRow>(rows, [](const LadderRow& r) { return dot(r.more_quality); }), false,
        true}});
}

Figure of_handler(const Document& document, const Table& table) {
  const auto& rows = experiments::rows_as<SystemRow>(table);
  Dots missed{"", kBlue, {}};
  Dots after_a_miss{"", kBlue, {}};
  for (const SystemRow& r : rows) {
    missed.dots.emplace_back(share_missed(r));
    const auto consecutive = static_cast<double>(r.consecutive.value_or(0));
    after_a_miss.dots.emplace_back(dot(100 * consecutive / static_cast<double>(r.rounds)));
  }
  return dots_of(
      document, table, rows, ": with and without the timeout handler",
      {{"rounds missed, %", {missed}}, {"rounds missed right after a miss, %", {after_a_miss}}});
}

// The deadline of every scenario of table-erdos.
constexpr double kDeadlineMs = 130;

// The rounds of one seed, ours above erdos_like.
Figure of_rounds(const Document& document) {
  std::string script =
      "set multiplot layout 2,1\nset ytics 50\nset tmargin 2.2\nset bmargin 2.6\nset rmargin 2\n"
      "unset key\n";
  for (const experiments::Series& series : document.series) {
    std::string on_time = "$on << EOD\n";
    std::string missed = "$missed << EOD\n";
    std::size_t misses = 0;
    for (const experiments::Point& p : series.points) {
      const bool good = p.on_time.value_or(false);
      (good ? on_time : missed) += fmt::format("{} {}\n", p.x, p.y);
      if (!good) ++misses;
    }
    script += on_time + "EOD\n" + missed + "-1 NaN\nEOD\n";
    script += fmt::format(
        "set title {}\nset ylabel 'e2e, ms'\nset xrange [-1:{}]\nset yrange [0:{}]\n"
        "set arrow 1 from graph 0, first {} to graph 1, first {} nohead dt 2 lc rgb '{}'\n"
        "plot $on with points pt 7 ps 0.45 lc rgb '{}' title 'on time', "
        "$missed with points pt 9 ps 0.9 lc rgb '{}' title 'missed'\n",
        records::gnuplot_text(
            fmt::format("{}: {} of {} rounds missed", series.name, misses, series.points.size())),
        series.points.size(), kDeadlineMs * 1.1, kDeadlineMs, kDeadlineMs, kRed, kBlue, kRed);
  }
  const std::uint64_t seed = document.seeds ? document.seeds->first : 0;
  return {.name = document.experiment + "-rounds",
          .caption = fmt::format("End-to-end time of each round of seed {}, uniform law, raw "
                                 "images. Blue: on time; red: missed; dashed: the deadline.",
                                 seed),
          .width = 480,
          .height = 400,
          .script = script + "unset multiplot\n",
          .is_headline = true};
}

}  // namespace

std::vector<Figure> system_figures(const Document& document) {
  std::vector<Figure> out;
  for (const Table& table : document.tables) {
    if (document.experiment == "ladder") {
      out.push_back(of_ladder(document, table));
    } else if (document.experiment == "timeout-handler") {
      out.push_back(of_handler(document, table));
    } else if (const auto* rows = std::get_if<std::vector<SystemRow>>(&table.rows)) {
      out.push_back(of_systems(document, table, *rows));
    }
  }
  if (!document.series.empty()) out.push_back(of_rounds(document));
  return out;
}

std::vector<Figure> sweep_figures(const Document& document) {
  constexpr const char* kColours[] = {kBlue, kPurple, kOrange, kRed, kGrey, kGreen, "#2aa3a3"};
  constexpr int kDashes[] = {1, 1, 1, 1, 2, 1, 2};
  const std::size_t columns = document.tables.size();
  std::string script = fmt::format(
      "set multiplot layout 2,{}\nset xrange [50:210]\nset xtics (60, 100, 130, 160, 200)\n",
      columns);
  for (const bool missed : {true, false}) {
    for (const Table& table : document.tables) {
      std::map<std::string, std::string> blocks;
      std::vector<std::string> order;
      for (const SystemRow& row : experiments::rows_as<SystemRow>(table)) {
        if (!blocks.contains(row.name)) order.push_back(row.name);
        blocks[row.name] += fmt::format("{} {}\n", row.sweep.value().deadline_ms,
                                        missed ? 100 * row.timeouts_share : row.quality);
      }
      std::string plot;
      for (std::size_t i = 0; i < order.size(); ++i) {
        script += fmt::format("$s{} << EOD\n{}EOD\n", i, blocks[order[i]]);
        // Lines lie on each other: the later one is dashed.
        plot += fmt::format("{}$s{} with linespoints pt 7 ps 0.5 lw 1.6 dt {} lc rgb '{}' title {}",
                            i == 0 ? "plot " : ", ", i, kDashes[i % std::size(kDashes)],
                            kColours[i % std::size(kColours)], records::gnuplot_text(order[i]));
      }
      // Where nothing is injected, hardly anything is missed: there is room.
      const bool key_here = &table == &document.tables.front() && missed;
      script += fmt::format(
          "set title {}\nset xlabel 'deadline, ms'\nset ylabel '{}'\nset yrange [0:*]\n{}\n{}\n",
          records::gnuplot_text(table.title), missed ? "rounds missed, %" : "quality",
          key_here ? "set key top right" : "unset key", plot);
    }
  }
  return {
      {.name = "sweep",
       .caption = "Rounds missed and quality by deadline, for injected delays from none to twice",
       .width = 1180,
       .height = 620,
       .script = script + "unset multiplot\n"}};
}

}  // namespace interneuron::report
