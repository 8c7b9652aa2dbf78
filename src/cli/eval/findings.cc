#include "cli/eval/findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "cli/eval/document.h"

namespace interneuron::cli::eval {
namespace {

// The aims of the evaluation (docs/evaluation.md).
constexpr double kFewerTimeouts = 0.95;  // than erdos_like; the paper: 0.947
constexpr double kMostApLost = 0.071;    // of erdos_like's AP on time; the paper's loss
constexpr double kOracleFactor = 1.1;    // timeouts
constexpr double kOracleSlack = 3.0;     // timeouts per 300 rounds
constexpr double kOracleQuality = 0.95;
constexpr double kOracleMayMiss = 0.005;     // of the rounds, under the uniform law
constexpr double kFewerInARow = 0.78;        // the paper's handler
constexpr std::uint64_t kMostDisturbed = 2;  // rounds, by a step of the clock
constexpr double kOnTimeDrift = 0.01;
constexpr double kMomentTolerance = 0.05;  // of the network table; chosen, as its test
constexpr const char* kOurs = "ours";

using Findings = std::vector<Finding>;

Finding judged(bool met, const std::string& text) {
  return {met ? Finding::Kind::kMet : Finding::Kind::kMissed, text};
}

const Json* row(const Json& rows, const std::string& name) {
  const auto found =
      std::ranges::find_if(rows, [&](const Json& r) { return r.at("name") == name; });
  return found == rows.end() ? nullptr : &*found;
}

double number(const Json& row, const char* key) { return row.at(key).get<double>(); }
bool known(const Json& row, const char* key) {
  return row.contains(key) && row.at(key).is_number();
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
    out.push_back(judged(lost <= kMostApLost,
                         fmt::format("{}: AP over rounds on time is {:.1f} % below erdos_like's; "
                                     "the paper loses {:.1f} %.",
                                     where, 100 * lost, 100 * kMostApLost)));
  }
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
  std::string near;
  for (const Json& other : rows) {
    if (!other.value("baseline", false) || !known(other, metric)) continue;
    if (number(other, metric) >= number(ours, metric)) {
      add_to(better, other, fmt::format("{:.4f}", number(other, metric)));
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
    if (erdos != nullptr && as_in_the_paper) against_erdos(where, *ours, *erdos, out);
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

// Which side of 0 an interval lies on: -1, 0 (it holds 0, or there is none), 1.
int side(const Json& paired) {
  const Json& ci = paired.at("ci95");
  if (ci.is_null()) return 0;
  return ci.at(0).get<double>() > 0 ? 1 : ci.at(1).get<double>() < 0 ? -1 : 0;
}

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
      out.push_back(judged(change <= -kFewerInARow,
                           fmt::format("{}: with the handler, {} misses {:+.0f} % rounds right "
                                       "after a miss; the paper has -78 %.",
                                       table.at("title").get<std::string>(),
                                       r.at("name").get<std::string>(), 100 * change)));
    }
  }
}

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
      out.push_back(judged(r.at("most_disturbed").get<std::uint64_t>() <= kMostDisturbed,
                           fmt::format("{}: the step costs {} rounds at most in any seed.", what,
                                       r.at("most_disturbed").get<std::uint64_t>())));
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
    out.push_back(judged(met, fmt::format("{}: avg, min, max and std are {}within 5 % of the "
                                          "paper's.",
                                          r.at("name").get<std::string>(), met ? "" : "not all ")));
  }
}

}  // namespace

std::vector<Finding> findings(const Json& document) {
  Findings out;
  const std::string experiment = document.at("experiment");
  if (experiment == "table-erdos") of_erdos(document, out);
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
