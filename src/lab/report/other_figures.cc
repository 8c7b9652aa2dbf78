// table-network, fig-adjust and fig-rt.
#include <fmt/format.h>

#include "lab/eval/experiments/document.h"
#include "lab/report/figure.h"

namespace interneuron::cli::report {
namespace {

using eval::find_table;

std::optional<Dot> dot(const Json& v) {
  if (!v.is_number()) return std::nullopt;
  return Dot{v, v, v};
}

Figure dots_figure(const std::string& name, const std::string& caption,
                   const std::vector<std::string>& labels, const std::vector<Panel>& panels) {
  return {name, caption, 980, dots_height(labels.size()), dot_panels(labels, panels)};
}

// Uplink, computation and downlink of each round on top of each other.
std::string stages_script(const Json& rows, double deadline) {
  std::string stages = "$stages << EOD\n";
  std::string at_d1 = "$atd1 << EOD\n";
  std::string late = "$late << EOD\n";
  std::string far = "$far << EOD\n";
  std::string x = "$x << EOD\n";
  for (const Json& r : rows) {
    const int round = r.at("round");
    x += fmt::format("{} {}\n", round, r.at("x").get<double>());
    if (!r.contains("theta1_ms") || r.at("theta2_ms").is_null()) continue;
    const double theta1 = r.at("theta1_ms");
    stages += fmt::format("{} {} {} {}\n", round, theta1, r.at("theta2_ms").get<double>(),
                          r.at("theta3_ms").get<double>());
    if (r.at("at_d1").get<bool>()) at_d1 += fmt::format("{} {}\n", round, theta1);
    if (!r.at("d1_missed").get<bool>()) continue;
    const bool very = r.at("marks").get<std::string>().find("≫") != std::string::npos;
    (very ? far : late) += fmt::format("{} {}\n", round, theta1);
  }
  std::string s = stages + "EOD\n" + at_d1 + "-9 NaN\nEOD\n" + late + "-9 NaN\nEOD\n" + far +
                  "-9 NaN\nEOD\n" + x + "EOD\n";
  s += fmt::format(
      "set multiplot\nset lmargin at screen 0.08\nset rmargin at screen 0.80\nset xrange "
      "[-0.7:{}]\nset xtics 1\nset tmargin at screen 0.93\nset bmargin at screen 0.36\nset yrange "
      "[0:{}]\nset ylabel 'since t0, ms'\nset format x ''\n"
      "set key outside right top\n"
      "set arrow 1 from graph 0, first {} to graph 1, first {} nohead dt 2 lw 1.5 lc rgb '{}'\n",
      static_cast<double>(rows.size()) - 0.3, deadline * 1.15, deadline, deadline, kRed);
  s += fmt::format(
      "plot $stages using 1:($2/2):(0.38):($2/2) with boxxyerror fs solid 0.75 noborder lc rgb "
      "'{0}' "
      "title 'uplink (θ1)', "
      "$stages using 1:(($2+$3)/2):(0.38):(($3-$2)/2) with boxxyerror fs solid 0.75 noborder lc "
      "rgb "
      "'{1}' title 'computation (θ2)', "
      "$stages using 1:(($3+$4)/2):(0.38):(($4-$3)/2) with boxxyerror fs solid 0.75 noborder lc "
      "rgb "
      "'{2}' title 'downlink (θ3)', "
      "$atd1 with points pt 6 ps 1.4 lw 2 lc rgb 'black' title 'θ1 = D1', "
      "$late with points pt 2 ps 1.3 lw 2.2 lc rgb 'black' title 'θ1 > D1', "
      "$far with points pt 1 ps 1.5 lw 2.4 lc rgb 'black' title 'θ1 ≫ D1', "
      "NaN with lines dt 2 lw 1.5 lc rgb '{3}' title 'D_N'\n",
      kBlue, kOrange, kGreen, kRed);
  return s +
         fmt::format(
             "unset arrow 1\nset tmargin at screen 0.30\nset bmargin at screen 0.12\nset format x "
             "'%g'\nset xlabel 'round'\nset ylabel 'X'\nset yrange [*:*]\nset ytics 0.1\n"
             "plot $x with linespoints pt 7 ps 0.6 lw 1.6 lc rgb '{}' title 'X'\nunset multiplot\n",
             kPurple);
}

Figure waterfall(const Json& w) {
  const Json& stages = w.at("stages");
  const double deadline = w.at("deadline_ms");
  std::vector<std::string> labels;
  std::string data;
  std::string plots;
  const auto add = [&](const std::string& label, const std::string& block, const std::string& how) {
    const std::size_t i = labels.size();
    labels.push_back(label);
    data += fmt::format("$row{} << EOD\n{}EOD\n", i, block);
    plots += fmt::format("{}$row{} {} notitle", plots.empty() ? "plot " : ", ", i, how);
  };
  const auto sends = [&](const char* direction) {
    for (const Json& send : w.at("sends")) {
      if (send.at("direction") != direction) continue;
      std::string block;
      for (const Json& at : send.at("sent_ms"))
        block += fmt::format("{} {}\n", at.get<double>(), labels.size());
      add(fmt::format("{} over {}: {} fragments", send.at("what").get<std::string>(),
                      send.at("link").get<std::string>(), send.at("fragments").get<int>()),
          block,
          fmt::format("using 1:2:(0):(0.3) with boxxyerror lc rgb '{}'",
                      send.at("link") == "5g" ? kBlue : kPurple));
    }
  };
  sends("up");
  const double theta1 = stages.at("theta1_ms");
  const double theta2 = stages.at("theta2_ms");
  add(fmt::format("computation, level {}", stages.at("level").get<int>()),
      fmt::format("{} {} {} {}\n", theta1, theta2, labels.size(), 0.3),
      fmt::format("using (($1+$2)/2):3:(($2-$1)/2):4 with boxxyerror fs solid 0.7 lc rgb '{}'",
                  kOrange));
  sends("down");
  std::string marks;
  // Each on a line of its own above the plot: instants may lie close together.
  std::size_t line = 0;
  const auto mark = [&](double at, const std::string& text, const char* colour, int dash) {
    marks += fmt::format(
        "set arrow from {0}, graph 0 to {0}, graph 1 nohead dt {1} lw 1.4 lc rgb '{2}'\n"
        "set label {3} at {0}, graph 1 offset 0.3,{4} tc rgb '{2}'\n",
        at, dash, colour, gnuplot_text(text), 4.5 - static_cast<double>(line++));
  };
  const bool at_d1 = stages.at("at_d1");
  if (!at_d1 && stages.at("d1_ms").is_number()) {
    mark(stages.at("d1_ms"), fmt::format("D1 = {:.1f}", stages.at("d1_ms").get<double>()), kOrange,
         2);
  }
  mark(theta1, fmt::format("θ1 = {}{:.1f}", at_d1 ? "D1 = " : "", theta1), "black", 1);
  mark(theta2, fmt::format("θ2 = {:.1f}", theta2), "black", 1);
  mark(stages.at("theta3_ms"), fmt::format("θ3 = {:.1f}", stages.at("theta3_ms").get<double>()),
       "black", 1);
  mark(deadline, fmt::format("D_N = {:.0f}", deadline), kRed, 2);
  std::string tics;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    tics += fmt::format("{}{} {}", i == 0 ? "" : ", ", gnuplot_text(labels[i]), i);
  }
  const std::string script = data + marks +
                             fmt::format(
                                 "set yrange [{}:-0.6]\nset xrange [0:{}]\nset ytics ({})\n"
                                 "set xlabel 'since t0, ms'\nset tmargin 6\n"
                                 "set lmargin at screen 0.26\nset rmargin at screen 0.93\n",
                                 static_cast<double>(labels.size()) - 0.4, deadline * 1.08, tics) +
                             plots + "\n";
  return {
      fmt::format("fig-rt-waterfall-{}", w.at("round").get<int>()),
      fmt::format("Where the time of round {} went: each fragment as it was sent, and when each "
                  "stage ended against its deadline",
                  w.at("round").get<int>()),
      980, 190 + 34 * static_cast<int>(labels.size()), script};
}

}  // namespace

std::vector<Figure> network_figures(const Json& document) {
  const Json& rows = document.at("tables").at(0).at("rows");
  std::string script = fmt::format("set multiplot layout {},1\n", document.at("series").size());
  for (std::size_t i = 0; i < document.at("series").size(); ++i) {
    const Json& series = document.at("series")[i];
    script += "$d << EOD\n";
    for (const Json& p : series.at("points")) {
      script += fmt::format("{} {}\n", p.at(0).get<double>(), p.at(1).get<double>());
    }
    const double avg = rows[i].at("paper_rtt_ms").at("avg");
    script += fmt::format(
        "EOD\nset title {}\nset xlabel 'time, s'\nset ylabel 'round trip, ms'\nset yrange [0:*]\n"
        "set key outside right top\nplot $d with steps lw 1.2 lc rgb '{}' title 'one drive', {} "
        "with lines dt 2 "
        "lc rgb '{}' title 'paper, avg'\n",
        gnuplot_text(series.at("name").get<std::string>()), kBlue, avg, kRed);
  }
  return {{"table-network", "One drive of each network; dashed: the paper's average", 980, 520,
           script + "unset multiplot\n"}};
}

std::vector<Figure> adjust_figures(const Json& document) {
  const Json& levels = (*find_table(document, "levels")).at("rows");
  const Json& sent = (*find_table(document, "transmission")).at("rows");
  std::vector<std::string> names;
  Series ap{"AP", kBlue, {}};
  Series ar{"AR", kOrange, {}};
  Series sampled{"AP, sampled", kBlue, {}, true};
  Series raw{"AP, raw", kBlue, {}};
  Series time{"median to p95", kBlue, {}};
  for (const Json& r : levels) {
    names.push_back(
        fmt::format("level {}, {}", r.at("level").get<int>(), r.at("name").get<std::string>()));
    ap.dots.push_back(dot(r.at("raw").at("ap")));
    ar.dots.push_back(dot(r.at("raw").at("ar")));
    raw.dots.push_back(dot(r.at("raw").at("ap")));
    sampled.dots.push_back(dot(r.at("sampled").at("ap")));
    time.dots.push_back(Dot{r.at("median_ms"), r.at("median_ms"), r.at("p95_ms")});
  }
  std::vector<std::string> messages;
  Series took{"median to p95", kBlue, {}};
  for (const Json& r : sent) {
    messages.push_back(fmt::format("{} KB over {}", r.at("kilobytes").get<int>(),
                                   r.at("network").get<std::string>()));
    took.dots.push_back(Dot{r.at("ms").at("p50"), r.at("ms").at("p50"), r.at("ms").at("p95")});
  }
  std::vector<Figure> out;
  if (levels.at(0).at("raw").at("ap").is_number()) {
    out.push_back(dots_figure("fig-adjust-a", "(a) Accuracy of the levels on raw images", names,
                              {{"COCO AP and AR", {ap, ar}}}));
  }
  out.push_back(dots_figure("fig-adjust-b", "(b) Run time of the levels", names,
                            {{"one thread, ms", {time}}}));
  if (levels.at(0).at("raw").at("ap").is_number()) {
    out.push_back(dots_figure("fig-adjust-c", "(c) Accuracy on raw and sampled images", names,
                              {{"COCO AP", {raw, sampled}}}));
  }
  out.push_back(dots_figure("fig-adjust-d", "(d) Transmission time of a message while driving",
                            messages, {{"ms, logarithmic", {took}, true}}));
  return out;
}

std::vector<Figure> rt_figures(const Json& document) {
  const double deadline = document.at("waterfalls").empty()
                              ? 130.0
                              : document.at("waterfalls").at(0).at("deadline_ms").get<double>();
  std::vector<Figure> out{{"fig-rt",
                           "The paper's sequence: uplink, computation and downlink of each round, "
                           "the guard's marks, and X below",
                           980, 520,
                           stages_script(document.at("tables").at(0).at("rows"), deadline)}};
  for (const Json& w : document.at("waterfalls")) out.push_back(waterfall(w));
  return out;
}

}  // namespace interneuron::cli::report
