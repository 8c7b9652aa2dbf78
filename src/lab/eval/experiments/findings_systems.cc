// Of table-erdos, sweep, ladder and timeout-handler.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "lab/eval/experiments/judged.h"

namespace interneuron::cli::eval {
namespace {

// The aims of the evaluation (docs/evaluation.md).
constexpr double kFewerTimeouts = 0.95;  // than erdos_like; the paper: 0.947
constexpr double kMostApLost = 0.071;    // of erdos_like's AP on time; the paper's loss
constexpr double kOracleFactor = 1.1;    // timeouts
constexpr double kOracleSlack = 3.0;     // timeouts per 300 rounds
constexpr double kOracleQuality = 0.95;
constexpr double kOracleMayMiss = 0.005;  // of the rounds, under the uniform law
constexpr double kFewerInARow = 0.78;     // the paper's handler
constexpr double kClose = 0.05;           // of ours, below it; chosen
constexpr const char* kOurs = "ours";

const Json* row(const Json& rows, const std::string& name) {
  const auto found =
      std::ranges::find_if(rows, [&](const Json& r) { return r.at("name") == name; });
  return found == rows.end() ? nullptr : &*found;
}

// The metric that tells what the application really got: with recordings, AP.
const char* worth(const Json& ours) {
  return known(ours, "effective_ap") ? "effective_ap" : "quality";
}

void against_erdos(const std::string& where, const Json& ours, const Json& erdos, Findings& out) {
  const double mine = number(ours, "timeouts");
  const double theirs = number(erdos, "timeouts");
  if (theirs > 0) {
    out.push_back(
        judged(mine <= (1 - kFewerTimeouts) * theirs,
               fmt::format("{}: ours has {:.1f} % fewer timeouts than erdos_like ({} "
                           "against {}); the aim is {:.0f} %, the paper has 94.7 %.",
                           where, 100 * (1 - mine / theirs), mine, theirs, 100 * kFewerTimeouts)));
  }
  if (known(ours, "ap") && known(erdos, "ap") && number(erdos, "ap") > 0) {
    const double lost = 1 - number(ours, "ap") / number(erdos, "ap");
    out.push_back(judged(
        lost <= kMostApLost,
        fmt::format("{}: AP over rounds on time is {:.1f} % {} erdos_like's; "
                    "the paper loses {:.1f} %.",
                    where, 100 * std::abs(lost), lost < 0 ? "above" : "below", 100 * kMostApLost)));
  }
}

// What the paper's own mechanism reaches here.
void of_paper(const std::string& where, const Json& paper, const Json& erdos, Findings& out) {
  if (number(erdos, "timeouts") <= 0) return;
  const double share = number(paper, "timeouts") / number(erdos, "timeouts");
  out.push_back({Finding::Kind::kNotice,
                 fmt::format("{}: the paper's guard, to the letter, has {:.1f} % fewer timeouts "
                             "than erdos_like ({} against {}); the paper measured 94.7 %.",
                             where, 100 * (1 - share), number(paper, "timeouts"),
                             number(erdos, "timeouts"))});
}

void against_oracle(const std::string& where, const Json& ours, const Json& oracle, Findings& out) {
  const double rounds = number(ours, "rounds");
  const double bound = kOracleFactor * number(oracle, "timeouts") + kOracleSlack * rounds / 300;
  out.push_back(
      judged(number(ours, "timeouts") <= bound,
             fmt::format("{}: {} timeouts of ours against the oracle's {}; the aim is at "
                         "most {:.0f}.",
                         where, number(ours, "timeouts"), number(oracle, "timeouts"), bound)));
  const double share = number(ours, "quality") / number(oracle, "quality");
  out.push_back(judged(share >= kOracleQuality,
                       fmt::format("{}: ours gets {:.1f} % of the oracle's quality; the aim is "
                                   "{:.0f} %.",
                                   where, 100 * share, 100 * kOracleQuality)));
}

// "b0 (0.35), duplicate (0.36)".
void add_to(std::string& list, const Json& row, const std::string& figure) {
  list +=
      fmt::format("{}{} ({})", list.empty() ? "" : ", ", row.at("name").get<std::string>(), figure);
}

// Which baselines of the table are as good as ours, or better.
void against_others(const std::string& where, const Json& rows, const Json& ours, Findings& out) {
  const char* metric = worth(ours);
  const char* spoken = std::string(metric) == "quality" ? "quality" : "effective AP";
  std::string better;
  std::string fewer;
  std::string near;   // in timeouts
  std::string close;  // in the metric
  for (const Json& other : rows) {
    if (!other.value("baseline", false) || !known(other, metric)) continue;
    const std::string figure = fmt::format("{:.4f}", number(other, metric));
    if (number(other, metric) >= number(ours, metric)) {
      add_to(better, other, figure);
    } else if (number(other, metric) >= (1 - kClose) * number(ours, metric)) {
      add_to(close, other, figure);
    }
    const Json& interval = other.at("timeouts_ci95");
    const Json& own = ours.at("timeouts_ci95");
    const std::string timeouts = fmt::format("{}", number(other, "timeouts"));
    if (interval.at(1) < own.at(0)) {
      add_to(fewer, other, timeouts);
    } else if (interval.at(0) <= own.at(1)) {
      add_to(near, other, timeouts);
    }
  }
  out.push_back(judged(better.empty(),
                       better.empty()
                           ? fmt::format("{}: ours has more {} than every baseline.", where, spoken)
                           : fmt::format("{}: with no less {} than ours ({:.4f}): {}.", where,
                                         spoken, number(ours, metric), better)));
  if (!close.empty()) {
    out.push_back({Finding::Kind::kNotice,
                   fmt::format("{}: less {} than ours ({:.4f}), but within {:.0f} %: {}.", where,
                               spoken, number(ours, metric), 100 * kClose, close)});
  }
  const double timeouts = number(ours, "timeouts");
  if (!fewer.empty()) {
    out.push_back(
        {Finding::Kind::kMissed,
         fmt::format("{}: with fewer timeouts than ours ({}): {}.", where, timeouts, fewer)});
  }
  if (!near.empty()) {
    out.push_back(
        {Finding::Kind::kNotice,
         fmt::format("{}: these rounds cannot tell the timeouts of ours ({}) from those of "
                     "{}: the 95 % intervals overlap.",
                     where, timeouts, near)});
  }
}

// Whether the simulation tells what happens for real; what differs, by part.
void of_agreement(const Json& rows, Findings& out) {
  for (const Json& r : rows) {
    const std::string name = r.at("name");
    const Json& on_time = r.at("on_time");
    out.push_back(judged(
        r.at("on_time_agrees").get<bool>(),
        fmt::format("Testbed and simulation, {}: {:.1f} % and {:.1f} % on time ({:+.1f} points); "
                    "the aim is 2 points.{}",
                    name, 100 * number(on_time, "testbed"), 100 * number(on_time, "sim"),
                    100 * number(on_time, "points"),
                    r.at("on_time_agrees").get<bool>()
                        ? ""
                        : " The simulation knows the median and 95th percentile of run times, "
                          "not the bursts of a busy machine.")));
    const Json& e2e = r.at("e2e_p50_ms");
    std::string text = fmt::format(
        "Testbed and simulation, {}: e2e p50 {:.1f} and {:.1f} ms ({:+.1f} %); the aim is 5 %.",
        name, number(e2e, "testbed"), number(e2e, "sim"), 100 * number(e2e, "change"));
    const auto parts_known = [&r](const char* side) { return known(r.at("uplink_ms"), side); };
    if (!r.at("e2e_agrees").get<bool>() && parts_known("testbed") && parts_known("sim")) {
      text += " Undisturbed rounds differ by";
      for (const char* part : {"uplink_ms", "compute_ms", "downlink_ms"}) {
        const Json& p = r.at(part);
        text += fmt::format(" {:+.1f} ms {}{}", number(p, "testbed") - number(p, "sim"),
                            part == std::string("uplink_ms")    ? "in the uplink"
                            : part == std::string("compute_ms") ? "from the hand-over to the "
                                                                  "computation's end"
                                                                : "in the downlink",
                            part == std::string("downlink_ms") ? "." : ",");
      }
    }
    out.push_back(judged(r.at("e2e_agrees").get<bool>(), text));
  }
}

}  // namespace

void of_erdos(const Json& document, Findings& out) {
  for (const Json& table : document.at("tables")) {
    const Json& rows = table.at("rows");
    if (table.at("name") == "agreement") {
      of_agreement(rows, out);
      continue;
    }
    const Json* ours = row(rows, kOurs);
    const Json* erdos = row(rows, "erdos_like");
    const Json* oracle = row(rows, "oracle");
    if (ours == nullptr) continue;
    const std::string where = table.at("title");
    // The law that is calibrated to the paper's figures.
    const bool as_in_the_paper = table.at("name") == "uniform";
    if (erdos != nullptr && as_in_the_paper) {
      against_erdos(where, *ours, *erdos, out);
      if (const Json* paper = row(rows, "paper")) of_paper(where, *paper, *erdos, out);
    }
    if (oracle != nullptr) against_oracle(where, *ours, *oracle, out);
    if (oracle != nullptr && as_in_the_paper) {
      const double share = number(*oracle, "timeouts") / number(*oracle, "rounds");
      out.push_back(judged(share <= kOracleMayMiss,
                           fmt::format("{}: the oracle misses {:.2f} % of the rounds; the law is "
                                       "fair up to {:.1f} %.",
                                       where, 100 * share, 100 * kOracleMayMiss)));
    }
    against_others(where, rows, *ours, out);
  }
}

// One sentence per severity, and one per deadline at which a baseline is ahead.
void of_sweep(const Json& document, Findings& out) {
  for (const Json& table : document.at("tables")) {
    std::map<int, std::pair<const Json*, const Json*>> best;  // ours, best baseline; by deadline
    for (const Json& r : table.at("rows")) {
      auto& [mine, theirs] = best[r.at("deadline_ms").get<int>()];
      if (r.at("name") == kOurs) mine = &r;
      if (!r.value("baseline", false)) continue;
      if (theirs == nullptr || number(r, "quality") > number(*theirs, "quality")) theirs = &r;
    }
    std::size_t ahead = 0;
    for (const auto& [deadline, rows] : best) {
      const auto& [mine, theirs] = rows;
      if (mine == nullptr || theirs == nullptr) continue;
      if (number(*mine, "quality") > number(*theirs, "quality")) {
        ++ahead;
        continue;
      }
      out.push_back({Finding::Kind::kNotice,
                     fmt::format("{}, {} ms: {} has no less quality than ours ({:.4f} against "
                                 "{:.4f}).",
                                 table.at("title").get<std::string>(), deadline,
                                 (*theirs).at("name").get<std::string>(),
                                 number(*theirs, "quality"), number(*mine, "quality"))});
    }
    out.push_back({Finding::Kind::kNotice,
                   fmt::format("{}: ours has more quality than every baseline at {} of {} "
                               "deadlines.",
                               table.at("title").get<std::string>(), ahead, best.size())});
  }
}

namespace {

// Which side of 0 an interval lies on: -1, 0 (it holds 0, or there is none), 1.
int side(const Json& paired) {
  const Json& ci = paired.at("ci95");
  if (ci.is_null()) return 0;
  return ci.at(0).get<double>() > 0 ? 1 : ci.at(1).get<double>() < 0 ? -1 : 0;
}

}  // namespace

void of_ladder(const Json& document, Findings& out) {
  for (const Json& table : document.at("tables")) {
    std::string better;    // baselines
    std::string worthier;  // forms of ours
    std::string fewer;
    std::string near;
    for (const Json& r : table.at("rows")) {
      if (r.at("name") == kOurs) continue;
      const Json& timeouts = r.at("more_timeouts_per_300");
      const Json& quality = r.at("more_quality");
      const std::string figure = fmt::format("{:+.4f}", number(quality, "mean"));
      if (side(quality) > 0) add_to(r.at("baseline").get<bool>() ? better : worthier, r, figure);
      if (side(timeouts) < 0) add_to(fewer, r, fmt::format("{:+.2f}", number(timeouts, "mean")));
      if (side(quality) == 0 && side(timeouts) == 0) add_to(near, r, figure);
    }
    const auto say = [&](bool missed, const char* what, const std::string& list) {
      if (list.empty()) return;
      out.push_back({missed ? Finding::Kind::kMissed : Finding::Kind::kNotice,
                     fmt::format("{}: {}: {}.", table.at("title").get<std::string>(), what, list)});
    };
    say(true, "baselines with more quality than ours", better);
    say(false, "forms of ours with more quality", worthier);
    say(false, "with fewer timeouts of 300 than ours", fewer);
    say(false, "within noise of ours, in timeouts and quality", near);
    if (better.empty()) {
      out.push_back(judged(true, fmt::format("{}: no baseline has more quality than ours.",
                                             table.at("title").get<std::string>())));
    }
  }
}

void of_handler(const Json& document, Findings& out) {
  for (const Json& table : document.at("tables")) {
    for (const Json& r : table.at("rows")) {
      if (!known(r, "consecutive_change")) continue;
      const double change = number(r, "consecutive_change");
      out.push_back(
          judged(change <= -kFewerInARow,
                 fmt::format(
                     "{}: {} misses {:+.1f} % rounds right after a miss, against the paper's guard "
                     "without its handler; the aim, and the paper's figure, is {:+.0f} %.",
                     table.at("title").get<std::string>(), r.at("name").get<std::string>(),
                     100 * change, -100 * kFewerInARow)));
    }
  }
}

}  // namespace interneuron::cli::eval
