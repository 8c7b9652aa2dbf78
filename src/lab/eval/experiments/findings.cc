#include "lab/eval/experiments/findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "lab/eval/experiments/judged.h"

namespace interneuron::experiments {
namespace {

// The aims of the evaluation (docs/evaluation.md).
// Rounds of one seed that a step of the clock may cost.
constexpr std::uint64_t kMostDisturbed = 2;
// The share of the rounds that a drift of the clock may move.
constexpr double kOnTimeDrift = 0.01;
// The share by which a moment of the network table may differ from the paper's, as its test has it.
constexpr double kMomentTolerance = 0.05;

void of_clock(const Document& document, Findings& out) {
  for (const ClockRow& r : rows_as<ClockRow>(document.tables.at(0))) {
    const std::string what = fmt::format("{}, {}", r.name, r.system);
    const auto timeouts = static_cast<double>(r.timeouts);
    const auto with_right_clock = static_cast<double>(r.timeouts_at_offset_0);
    const auto rounds = static_cast<double>(r.rounds);
    switch (r.kind) {
      case ClockFault::kOffset:
        out.push_back(
            judged(r.differ_at_all == 0,
                   fmt::format("{}: {} rounds differ, to the nanosecond.", what, r.differ_at_all)));
        break;
      case ClockFault::kDrift: {
        const double moved = std::abs(timeouts - with_right_clock);
        out.push_back(judged(
            moved <= kOnTimeDrift * rounds,
            fmt::format("{}: {} rounds more or fewer on time, of {}.", what, moved, rounds)));
        break;
      }
      case ClockFault::kStep:
        out.push_back(
            judged(r.most_disturbed <= kMostDisturbed,
                   fmt::format("{}: at most {} rounds of a seed are missed that the right clock "
                               "makes; {} timeouts in all, against {}.",
                               what, r.most_disturbed, timeouts, with_right_clock)));
        break;
    }
  }
}

void of_network(const Document& document, Findings& out) {
  for (const NetworkRow& r : rows_as<NetworkRow>(document.tables.at(0))) {
    if (!r.rtt_ms) continue;
    const bool met = std::ranges::all_of(
        std::array{&Moments::avg, &Moments::min, &Moments::max, &Moments::std}, [&r](auto moment) {
          const double paper = r.paper_rtt_ms.*moment;
          return std::abs((*r.rtt_ms).*moment - paper) <= kMomentTolerance * paper;
        });
    out.push_back(judged(met, fmt::format("{}: avg, min, max and std of {} pings are {}within 5 % "
                                          "of the paper's.",
                                          r.name, r.pings, met ? "" : "not all ")));
  }
}

// A phase of docs/paper.md, "The scripted sequence"; it holds for all of its rounds.
struct Phase {
  std::size_t first;
  std::size_t last;
  const char* says;
  bool (*holds)(const ScriptRow& row, const std::vector<ScriptRow>& rows);
};
using Script = std::vector<ScriptRow>;
constexpr Phase kPhases[] = {
    {0, 2, "normal, the raw image and the best model",
     [](const ScriptRow& r, const Script& rows) {
       return r.road->image == "raw" && rows[0].road && r.road->level == rows[0].road->level &&
              !r.road->d1_missed;
     }},
    {3, 4, "raw comes later than before, but within D1",
     [](const ScriptRow& r, const Script& rows) {
       return r.road->image == "raw" && !r.road->d1_missed && rows[2].road &&
              r.road->theta1_ms > rows[2].road->theta1_ms;
     }},
    {5, 7, "X has fallen; raw misses D1, the sampled image is used at exactly D1",
     [](const ScriptRow& r, const Script& rows) {
       return r.road->at_d1 && r.road->image == "sampled" && r.x < rows[3].x;
     }},
    {8, 9, "D1 is missed, a lighter model",
     [](const ScriptRow& r, const Script& rows) {
       return r.road->d1_missed && r.road->level > 0 && rows[0].road &&
              r.road->level < rows[0].road->level;
     }},
    {10, 12, "D1 is missed, the lightest model",
     [](const ScriptRow& r, const Script&) { return r.road->d1_missed && r.road->level == 0; }},
    {11, 12, "D2 is missed too, the third module is sacrificed",
     [](const ScriptRow& r, const Script&) { return r.road->d2_missed; }},
    {0, 12, "answered remotely by the deadline",
     [](const ScriptRow& r, const Script&) { return r.on_time; }}};

void of_fig_rt(const Document& document, Findings& out) {
  const Script& rows = rows_as<ScriptRow>(document.tables.at(0));
  for (const Phase& phase : kPhases) {
    bool met = true;
    for (std::size_t i = phase.first; i <= phase.last; ++i) {
      // A phase does not hold with a round that the roadside never saw.
      met = met && rows.at(i).road && phase.holds(rows.at(i), rows);
    }
    out.push_back(judged(met, fmt::format("rounds {}-{}: {}{}.", phase.first, phase.last,
                                          met ? "" : "not all as in the paper, ", phase.says)));
  }
}

}  // namespace

std::vector<Finding> findings(const Document& document) {
  Findings out;
  const std::string& experiment = document.experiment;
  if (experiment == "table-erdos") of_erdos(document, out);
  if (experiment == "table-lidar") of_lidar(document, out);
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

}  // namespace interneuron::experiments
