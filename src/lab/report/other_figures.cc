// table-network, fig-adjust and fig-rt.
#include <fmt/format.h>

#include "lab/eval/experiments/document.h"
#include "lab/report/figure.h"

namespace interneuron::report {
namespace {

using experiments::ScriptRow;
using experiments::Waterfall;

std::optional<Dot> dot(const std::optional<double>& v) {
  if (!v) return std::nullopt;
  return Dot{*v, *v, *v};
}

Figure dots_figure(const std::string& name, const std::string& caption,
                   const std::vector<std::string>& labels, const std::vector<Panel>& panels) {
  return {.name = name,
          .caption = caption,
          .height = dots_height(labels.size()),
          .script = dot_panels(labels, panels)};
}

// Uplink, computation and downlink of each round on top of each other.
std::string stages_script(const std::vector<ScriptRow>& rows, double deadline) {
  std::string stages = "$stages << EOD\n";
  std::string at_d1 = "$atd1 << EOD\n";
  std::string late = "$late << EOD\n";
  std::string far = "$far << EOD\n";
  std::string x = "$x << EOD\n";
  for (const ScriptRow& r : rows) {
    x += fmt::format("{} {}\n", r.round, r.x);
    if (!r.road || !r.road->theta2_ms) continue;
    const double theta1 = r.road->theta1_ms;
    stages += fmt::format("{} {} {} {}\n", r.round, theta1, *r.road->theta2_ms, r.theta3_ms);
    if (r.road->at_d1) at_d1 += fmt::format("{} {}\n", r.round, theta1);
    if (!r.road->d1_missed) continue;
    const bool very = r.road->marks.find("≫") != std::string::npos;
    (very ? far : late) += fmt::format("{} {}\n", r.round, theta1);
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

// The instants at which stages ended, and their deadlines, as lines from top to bottom.
std::string marks_of(const Waterfall& w) {
  const ScriptRow::Road stages = w.stages.road.value();
  std::string marks;
  // Each on a line of its own above the plot: instants may lie close together.
  std::size_t line = 0;
  const auto mark = [&](double at, const std::string& text, const char* colour, int dash) {
    marks += fmt::format(
        "set arrow from {0}, graph 0 to {0}, graph 1 nohead dt {1} lw 1.4 lc rgb '{2}'\n"
        "set label {3} at {0}, graph 1 offset 0.3,{4} tc rgb '{2}'\n",
        at, dash, colour, records::gnuplot_text(text), 4.5 - static_cast<double>(line++));
  };
  const double theta2 = stages.theta2_ms.value();
  const bool at_d1 = stages.at_d1;
  if (!at_d1 && stages.d1_ms) {
    mark(*stages.d1_ms, fmt::format("D1 = {:.1f}", *stages.d1_ms), kOrange, 2);
  }
  mark(stages.theta1_ms, fmt::format("θ1 = {}{:.1f}", at_d1 ? "D1 = " : "", stages.theta1_ms),
       "black", 1);
  mark(theta2, fmt::format("θ2 = {:.1f}", theta2), "black", 1);
  mark(w.stages.theta3_ms, fmt::format("θ3 = {:.1f}", w.stages.theta3_ms), "black", 1);
  mark(w.deadline_ms, fmt::format("D_N = {:.0f}", w.deadline_ms), kRed, 2);
  return marks;
}

Figure waterfall(const Waterfall& w) {
  const ScriptRow::Road stages = w.stages.road.value();
  const double deadline = w.deadline_ms;
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
    for (const Waterfall::Send& send : w.sends) {
      if (send.direction != direction) continue;
      std::string block;
      for (const double at : send.sent_ms) block += fmt::format("{} {}\n", at, labels.size());
      add(fmt::format("{} over {}: {} fragments", send.what, send.link, send.fragments), block,
          fmt::format("using 1:2:(0):(0.3) with boxxyerror lc rgb '{}'",
                      send.link == "5g" ? kBlue : kPurple));
    }
  };
  sends("up");
  const double theta1 = stages.theta1_ms;
  const double theta2 = stages.theta2_ms.value();
  add(fmt::format("computation, level {}", stages.level),
      fmt::format("{} {} {} {}\n", theta1, theta2, labels.size(), 0.3),
      fmt::format("using (($1+$2)/2):3:(($2-$1)/2):4 with boxxyerror fs solid 0.7 lc rgb '{}'",
                  kOrange));
  sends("down");
  std::string tics;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    tics += fmt::format("{}{} {}", i == 0 ? "" : ", ", records::gnuplot_text(labels[i]), i);
  }
  const std::string script = data + marks_of(w) +
                             fmt::format(
                                 "set yrange [{}:-0.6]\nset xrange [0:{}]\nset ytics ({})\n"
                                 "set xlabel 'since t0, ms'\nset tmargin 6\n"
                                 "set lmargin at screen 0.26\nset rmargin at screen 0.93\n",
                                 static_cast<double>(labels.size()) - 0.4, deadline * 1.08, tics) +
                             plots + "\n";
  return {.name = fmt::format("fig-rt-waterfall-{}", w.round),
          .caption = fmt::format("Where the time of round {} went: each fragment as it was sent, "
                                 "and when each stage ended against its deadline",
                                 w.round),
          .height = 190 + 34 * static_cast<int>(labels.size()),
          .script = script};
}

}  // namespace

std::vector<Figure> network_figures(const Document& document) {
  const auto& rows = experiments::rows_as<experiments::NetworkRow>(document.tables.at(0));
  std::string script = fmt::format("set multiplot layout {},1\n", document.series.size());
  for (std::size_t i = 0; i < document.series.size(); ++i) {
    const experiments::Series& series = document.series[i];
    script += "$d << EOD\n";
    for (const experiments::Point& p : series.points) script += fmt::format("{} {}\n", p.x, p.y);
    script += fmt::format(
        "EOD\nset title {}\nset xlabel 'time, s'\nset ylabel 'round trip, ms'\nset yrange [0:*]\n"
        "set key outside right top\nplot $d with steps lw 1.2 lc rgb '{}' title 'one drive', {} "
        "with lines dt 2 "
        "lc rgb '{}' title 'paper, avg'\n",
        records::gnuplot_text(series.name), kBlue, rows.at(i).paper_rtt_ms.avg, kRed);
  }
  return {{.name = "table-network",
           .caption = "One drive of each network; dashed: the paper's average",
           .height = 520,
           .script = script + "unset multiplot\n"}};
}

std::vector<Figure> adjust_figures(const Document& document) {
  const auto& levels = experiments::rows_as<experiments::LevelRow>(*find_table(document, "levels"));
  const auto& sent =
      experiments::rows_as<experiments::TransmissionRow>(*find_table(document, "transmission"));
  std::vector<std::string> names;
  Dots ap{"AP", kBlue, {}};
  Dots ar{"AR", kOrange, {}};
  Dots sampled{"AP, sampled", kBlue, {}, true};
  Dots raw{"AP, raw", kBlue, {}};
  Dots time{"median to p95", kBlue, {}};
  for (const experiments::LevelRow& r : levels) {
    names.push_back(fmt::format("level {}, {}", r.level, r.name));
    ap.dots.push_back(dot(r.raw.ap));
    ar.dots.push_back(dot(r.raw.ar));
    raw.dots.push_back(dot(r.raw.ap));
    sampled.dots.push_back(dot(r.sampled.ap));
    time.dots.push_back(Dot{r.median_ms, r.median_ms, r.p95_ms});
  }
  std::vector<std::string> messages;
  Dots took{"median to p95", kBlue, {}};
  for (const experiments::TransmissionRow& r : sent) {
    messages.push_back(fmt::format("{} KB over {}", r.kilobytes, r.network));
    took.dots.push_back(Dot{r.ms.p50, r.ms.p50, r.ms.p95});
  }
  std::vector<Figure> out;
  const bool scored = levels.at(0).raw.ap.has_value();
  if (scored) {
    out.push_back(dots_figure("fig-adjust-a", "(a) Accuracy of the levels on raw images", names,
                              {{"COCO AP and AR", {ap, ar}}}));
  }
  out.push_back(dots_figure("fig-adjust-b", "(b) Run time of the levels", names,
                            {{"one thread, ms", {time}}}));
  if (scored) {
    out.push_back(dots_figure("fig-adjust-c", "(c) Accuracy on raw and sampled images", names,
                              {{"COCO AP", {raw, sampled}}}));
  }
  out.push_back(dots_figure("fig-adjust-d", "(d) Transmission time of a message while driving",
                            messages, {{"ms, logarithmic", {took}, true}}));
  return out;
}

std::vector<Figure> rt_figures(const Document& document) {
  constexpr double kUsualDeadlineMs = 130;
  const double deadline =
      document.waterfalls.empty() ? kUsualDeadlineMs : document.waterfalls[0].deadline_ms;
  const auto& rows = experiments::rows_as<ScriptRow>(document.tables.at(0));
  std::vector<Figure> out{{.name = "fig-rt",
                           .caption = "The paper's sequence: uplink, computation and downlink of "
                                      "each round, the guard's marks, and X below",
                           .height = 520,
                           .script = stages_script(rows, deadline)}};
  for (const Waterfall& w : document.waterfalls) out.push_back(waterfall(w));
  return out;
}

}  // namespace interneuron::report
