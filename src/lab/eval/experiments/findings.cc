#include "lab/eval/experiments/findings.h"

#include <fmt/format.h>

#include <cmath>

#include "lab/eval/experiments/judged.h"

namespace interneuron::cli::eval {
namespace {

// The aims of the evaluation (docs/evaluation.md).
constexpr std::uint64_t kMostDisturbed = 2;  // rounds, by a step of the clock
constexpr double kOnTimeDrift = 0.01;
constexpr double kMomentTolerance = 0.05;  // of the network table; chosen, as its test

void of_clock(const Json& document, Findings& out) {
  for (const Json& r : document.at("tables").at(0).at("rows")) {
    const std::string what =
        fmt::format("{}, {}", r.at("name").get<std::string>(), r.at("system").get<std::string>());
    if (r.at("kind") == "offset") {
      out.push_back(judged(r.at("differ_at_all") == 0,
                           fmt::format("{}: {} rounds differ, to the nanosecond.", what,
                                       r.at("differ_at_all").get<std::uint64_t>())));
    } else if (r.at("kind") == "drift") {
      const double moved = std::abs(number(r, "timeouts") - number(r, "timeouts_at_offset_0"));
      out.push_back(judged(moved <= kOnTimeDrift * number(r, "rounds"),
                           fmt::format("{}: {} rounds more or fewer on time, of {}.", what, moved,
                                       number(r, "rounds"))));
    } else {
      out.push_back(
          judged(r.at("most_disturbed").get<std::uint64_t>() <= kMostDisturbed,
                 fmt::format("{}: at most {} rounds of a seed are missed that the right clock "
                             "makes; {} timeouts in all, against {}.",
                             what, r.at("most_disturbed").get<std::uint64_t>(),
                             number(r, "timeouts"), number(r, "timeouts_at_offset_0"))));
    }
  }
}

void of_network(const Json& document, Findings& out) {
  for (const Json& r : document.at("tables").at(0).at("rows")) {
    if (r.at("rtt_ms").is_null()) continue;
    bool met = true;
    for (const char* moment : {"avg", "min", "max", "std"}) {
      const double paper = number(r.at("paper_rtt_ms"), moment);
      met = met && std::abs(number(r.at("rtt_ms"), moment) - paper) <= kMomentTolerance * paper;
    }
    out.push_back(
        judged(met, fmt::format("{}: avg, min, max and std of {} pings are {}within 5 % "
                                "of the paper's.",
                                r.at("name").get<std::string>(), r.at("pings").get<std::uint64_t>(),
                                met ? "" : "not all ")));
  }
}

// A phase of docs/paper.md, "The scripted sequence"; it holds for all of its rounds.
struct Phase {
  std::size_t first;
  std::size_t last;
  const char* says;
  bool (*holds)(const Json& row, const Json& rows);
};
constexpr Phase kPhases[] = {
    {0, 2, "normal, the raw image and the best model",
     [](const Json& r, const Json& rows) {
       return r.at("image") == "raw" && r.at("level") == rows.at(0).at("level") &&
              !r.at("d1_missed").get<bool>();
     }},
    {3, 4, "raw comes later than before, but within D1",
     [](const Json& r, const Json& rows) {
       return r.at("image") == "raw" && !r.at("d1_missed").get<bool>() &&
              number(r, "theta1_ms") > number(rows.at(2), "theta1_ms");
     }},
    {5, 7, "X has fallen; raw misses D1, the sampled image is used at exactly D1",
     [](const Json& r, const Json& rows) {
       return r.at("at_d1").get<bool>() && r.at("image") == "sampled" &&
              number(r, "x") < number(rows.at(3), "x");
     }},
    {8, 9, "D1 is missed, a lighter model",
     [](const Json& r, const Json& rows) {
       return r.at("d1_missed").get<bool>() && r.at("level") > 0 &&
              r.at("level") < rows.at(0).at("level");
     }},
    {10, 12, "D1 is missed, the lightest model",
     [](const Json& r, const Json&) {
       return r.at("d1_missed").get<bool>() && r.at("level") == 0;
     }},
    {11, 12, "D2 is missed too, the third module is sacrificed",
     [](const Json& r, const Json&) { return r.at("d2_missed").get<bool>(); }},
    {0, 12, "answered remotely by the deadline",
     [](const Json& r, const Json&) { return r.at("on_time").get<bool>(); }}};

void of_fig_rt(const Json& document, Findings& out) {
  const Json& rows = document.at("tables").at(0).at("rows");
  for (const Phase& phase : kPhases) {
    bool met = true;
    for (std::size_t i = phase.first; i <= phase.last; ++i) {
      // A round that the roadside never saw has no such keys.
      met = met && rows.at(i).contains("theta1_ms") && phase.holds(rows.at(i), rows);
    }
    out.push_back(judged(met, fmt::format("rounds {}-{}: {}{}.", phase.first, phase.last,
                                          met ? "" : "not all as in the paper, ", phase.says)));
  }
}

}  // namespace

std::vector<Finding> findings(const Json& document) {
  Findings out;
  const std::string experiment = document.at("experiment");
  if (experiment == "table-erdos") of_erdos(document, out);
  if (experiment == "fig-rt") of_fig_rt(document, out);
  if (experiment == "sweep") of_sweep(document, out);
  if (experiment == "ladder") of_ladder(document, out);
  if (experiment == "timeout-handler") of_handler(document, out);
  if (experiment == "clock") of_clock(document, out);
  if (experiment == "table-network") of_network(document, out);
  return out;
}

const char* mark(Finding::Kind kind) {
  switch (kind) {
    case Finding::Kind::kMet:
      return "met:   ";
    case Finding::Kind::kMissed:
      return "MISSED:";
    case Finding::Kind::kNotice:
      return "note:  ";
  }
  return "";
}

}  // namespace interneuron::cli::eval
