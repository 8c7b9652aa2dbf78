// Systems side by side: timeouts and what was got, with intervals.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "lab/eval/experiments/document.h"
#include "lab/report/figure.h"

namespace interneuron::cli::report {
namespace {

const char* colour_of(const Json& row) {
  if (row.at("name") == "oracle" || row.at("name") == "causal") return kGreen;
  return row.value("baseline", false) ? kOrange : kBlue;
}

std::optional<Dot> dot_at(const Json& row, const char* value, const char* interval, double scale) {
  const Json::json_pointer at(value);
  if (!row.contains(at) || !row[at].is_number()) return std::nullopt;
  const double v = row[at].get<double>() * scale;
  const Json::json_pointer ci(interval);
  if (*interval == '\0' || !row.contains(ci) || row[ci].is_null()) return Dot{v, v, v};
  return Dot{v, row[ci].at(0).get<double>() * scale, row[ci].at(1).get<double>() * scale};
}

// One series per colour, so that the key tells them apart.
std::vector<Series> by_kind(const Json& rows, const char* value, const char* interval,
                            double scale = 1) {
  std::vector<Series> out{{"ours", kBlue, {}}, {"baselines", kOrange, {}}, {"bounds", kGreen, {}}};
  for (Series& series : out) {
    for (const Json& row : rows) {
      series.dots.push_back(series.colour == colour_of(row) ? dot_at(row, value, interval, scale)
                                                            : std::nullopt);
    }
  }
  return out;
}

bool any(const Json& rows, const char* key) {
  return std::ranges::any_of(
      rows, [key](const Json& r) { return r.contains(key) && r.at(key).is_number(); });
}

std::vector<std::string> names_of(const Json& rows) {
  std::vector<std::string> out;
  for (const Json& row : rows) out.push_back(row.at("name"));
  return out;
}

Figure of_systems(const Json& document, const Json& table) {
  const Json& rows = table.at("rows");
  std::vector<Panel> panels{
      {"rounds missed, %", by_kind(rows, "/timeouts_share", "/timeouts_ci95", 100)}};
  if (any(rows, "effective_ap")) {
    panels.push_back({"effective AP", by_kind(rows, "/effective_ap", "")});
  }
  panels.push_back({"quality", by_kind(rows, "/quality", "")});
  const std::vector<std::string> names = names_of(rows);
  return {fmt::format("{}-{}", document.at("experiment").get<std::string>(),
                      table.at("name").get<std::string>()),
          table.at("title").get<std::string>() +
              ": rounds missed (95 % intervals) and what the "
              "application really got",
          980, dots_height(names.size()), dot_panels(names, panels)};
}

Figure of_ladder(const Json& document, const Json& table) {
  const Json& rows = table.at("rows");
  std::vector<Panel> panels{
      {"timeouts more than ours, of 300",
       by_kind(rows, "/more_timeouts_per_300/mean", "/more_timeouts_per_300/ci95"), false, true},
      {"quality more than ours", by_kind(rows, "/more_quality/mean", "/more_quality/ci95"), false,
       true}};
  const std::vector<std::string> names = names_of(rows);
  return {fmt::format("{}-{}", document.at("experiment").get<std::string>(),
                      table.at("name").get<std::string>()),
          table.at("title").get<std::string>(), 980, dots_height(names.size()),
          dot_panels(names, panels)};
}

Figure of_handler(const Json& document, const Json& table) {
  const Json& rows = table.at("rows");
  std::vector<Panel> panels{
      {"rounds missed, %", {{"", kBlue, {}}}},
      {"rounds missed right after a miss, %", {{"", kBlue, {}}}},
  };
  for (const Json& row : rows) {
    panels[0].series[0].dots.push_back(dot_at(row, "/timeouts_share", "/timeouts_ci95", 100));
    panels[1].series[0].dots.push_back(
        dot_at(row, "/consecutive", "", 100.0 / row.at("rounds").get<double>()));
  }
  const std::vector<std::string> names = names_of(rows);
  return {fmt::format("{}-{}", document.at("experiment").get<std::string>(),
                      table.at("name").get<std::string>()),
          table.at("title").get<std::string>() + ": with and without the timeout handler", 980,
          dots_height(names.size()), dot_panels(names, panels)};
}

// The rounds of one seed, ours above erdos_like.
Figure of_rounds(const Json& document) {
  const double deadline = document.value("deadline_ms", 130.0);
  std::string script = "set multiplot layout 2,1\nset yrange [0:*]\n";
  for (const Json& series : document.at("series")) {
    std::string on_time = "$on << EOD\n";
    std::string missed = "$missed << EOD\n";
    for (const Json& p : series.at("points")) {
      (p.at(2) == 1 ? on_time : missed) +=
          fmt::format("{} {}\n", p.at(0).get<int>(), p.at(1).get<double>());
    }
    script += on_time + "EOD\n" + missed + "-1 NaN\nEOD\n";
    script += fmt::format(
        "set title {}\nset ylabel 'e2e, ms'\nset xrange [-1:{}]\nset yrange [0:{}]\n"
        "set arrow 1 from graph 0, first {} to graph 1, first {} nohead dt 2 lc rgb '{}'\n"
        "set key outside right top\n"
        "plot $on with points pt 7 ps 0.45 lc rgb '{}' title 'on time', "
        "$missed with points pt 9 ps 0.9 lc rgb '{}' title 'missed'\n",
        gnuplot_text(series.at("name").get<std::string>()), series.at("points").size(),
        deadline * 1.1, deadline, deadline, kRed, kBlue, kRed);
  }
  return {fmt::format("{}-rounds", document.at("experiment").get<std::string>()),
          fmt::format("End-to-end time of each round of seed {}, uniform law, raw images; dashed: "
                      "the deadline",
                      document.at("seeds").at(0).get<std::uint64_t>()),
          980, 480, script + "unset multiplot\n"};
}

}  // namespace

std::vector<Figure> system_figures(const Json& document) {
  std::vector<Figure> out;
  const std::string experiment = document.at("experiment");
  for (const Json& table : document.at("tables")) {
    if (experiment == "ladder") {
      out.push_back(of_ladder(document, table));
    } else if (experiment == "timeout-handler") {
      out.push_back(of_handler(document, table));
    } else if (experiment == "table-erdos" && table.at("name") != "paper" &&
               table.at("rows").at(0).contains("quality")) {
      out.push_back(of_systems(document, table));
    }
  }
  if (experiment == "table-erdos" && !document.at("series").empty())
    out.push_back(of_rounds(document));
  return out;
}

std::vector<Figure> sweep_figures(const Json& document) {
  constexpr const char* kColours[] = {kBlue, kPurple, kOrange, kRed, kGrey, kGreen, "#2aa3a3"};
  constexpr int kDashes[] = {1, 1, 1, 1, 2, 1, 2};
  const std::size_t columns = document.at("tables").size();
  std::string script = fmt::format(
      "set multiplot layout 2,{}\nset xrange [50:210]\nset xtics (60, 100, 130, 160, 200)\n",
      columns);
  for (const auto& [key, label, scale] : {std::tuple{"timeouts_share", "rounds missed, %", 100.0},
                                          std::tuple{"quality", "quality", 1.0}}) {
    for (const Json& table : document.at("tables")) {
      std::map<std::string, std::string> blocks;
      std::vector<std::string> order;
      for (const Json& row : table.at("rows")) {
        const std::string name = row.at("name");
        if (!blocks.contains(name)) order.push_back(name);
        blocks[name] += fmt::format("{} {}\n", row.at("deadline_ms").get<int>(),
                                    row.at(key).template get<double>() * scale);
      }
      std::string plot;
      for (std::size_t i = 0; i < order.size(); ++i) {
        script += fmt::format("$s{} << EOD\n{}EOD\n", i, blocks[order[i]]);
        // Lines lie on each other: the later one is dashed.
        plot += fmt::format("{}$s{} with linespoints pt 7 ps 0.5 lw 1.6 dt {} lc rgb '{}' title {}",
                            i == 0 ? "plot " : ", ", i, kDashes[i % std::size(kDashes)],
                            kColours[i % std::size(kColours)], gnuplot_text(order[i]));
      }
      // Where nothing is injected, hardly anything is missed: there is room.
      const bool key_here = &table == &document.at("tables").front() && scale != 1.0;
      script += fmt::format(
          "set title {}\nset xlabel 'deadline, ms'\nset ylabel '{}'\nset yrange [0:*]\n{}\n{}\n",
          gnuplot_text(table.at("title").get<std::string>()), label,
          key_here ? "set key top right" : "unset key", plot);
    }
  }
  return {{"sweep", "Rounds missed and quality by deadline, for injected delays from none to twice",
           1180, 620, script + "unset multiplot\n"}};
}

}  // namespace interneuron::cli::report
