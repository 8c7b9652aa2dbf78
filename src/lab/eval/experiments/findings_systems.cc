// What is found in table-erdos, sweep, ladder and timeout-handler.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "lab/eval/bounds.h"
#include "lab/eval/experiments/judged.h"

namespace interneuron::experiments {
namespace {

// The aims of the evaluation (docs/evaluation.md).
// The share of erdos_like's timeouts that ours avoids; the paper has 0.947.
constexpr double kFewerTimeouts = 0.95;
// The share of erdos_like's AP on time that ours may lose; the paper loses as much.
constexpr double kMostApLost = 0.071;
// Under the law of delays of one network, the paper's table: erdos_like misses half of the rounds,
// the paper's guard 94.7 % fewer, and loses 7.1 % of the accuracy of rounds on time.
constexpr double kErdosMisses[] = {0.45, 0.55};
constexpr double kPaperFewer = 0.92;
constexpr double kPaperApLost[] = {0.04, 0.10};
// The share of what causal_player() gets that ours reaches where no system can be near the oracle.
constexpr double kPlayerShare = 0.98;
// At most so many times the oracle's timeouts, and so many more per 300 rounds.
constexpr double kOracleFactor = 1.1;
constexpr double kOracleSlack = 3.0;
// The share of the oracle's quality that ours reaches.
constexpr double kOracleQuality = 0.95;
// The share of the rounds that the oracle itself may miss under the uniform law.
constexpr double kOracleMayMiss = 0.005;
// The share of consecutive timeouts that the paper's handler avoids.
constexpr double kFewerInARow = 0.78;
// A baseline is close when it has at least all but this share of what ours has.
constexpr double kClose = 0.05;
constexpr const char* kOurs = "ours";

const SystemRow* find(const std::vector<SystemRow>& rows, const char* name) {
  const auto found = std::ranges::find(rows, name, &SystemRow::name);
  return found == rows.end() ? nullptr : &*found;
}

double timeouts_of(const SystemRow& row) { return static_cast<double>(row.timeouts); }

void against_erdos(const std::string& where, const SystemRow& ours, const SystemRow& erdos,
                   Findings& out) {
  const double mine = timeouts_of(ours);
  const double theirs = timeouts_of(erdos);
  if (theirs > 0) {
    out.push_back(
        judged(mine <= (1 - kFewerTimeouts) * theirs,
               fmt::format("{}: ours has {:.1f} % fewer timeouts than erdos_like ({} "
                           "against {}); the aim is {:.0f} %, the paper has 94.7 %.",
                           where, 100 * (1 - mine / theirs), mine, theirs, 100 * kFewerTimeouts)));
  }
  if (ours.ap && erdos.ap && *erdos.ap > 0) {
    const double lost = 1 - *ours.ap / *erdos.ap;
    out.push_back(judged(
        lost <= kMostApLost,
        fmt::format("{}: AP over rounds on time is {:.1f} % {} erdos_like's; "
                    "the paper loses {:.1f} %.",
                    where, 100 * std::abs(lost), lost < 0 ? "above" : "below", 100 * kMostApLost)));
  }
}

// What the paper's own mechanism reaches here.
void of_paper(const std::string& where, const SystemRow& paper, const SystemRow& erdos,
              Findings& out) {
  if (erdos.timeouts == 0) return;
  const double share = timeouts_of(paper) / timeouts_of(erdos);
  out.push_back({Finding::Kind::kNotice,
                 fmt::format("{}: the paper's guard has {:.1f} % fewer timeouts "
                             "than erdos_like ({} against {}); the paper measured 94.7 %.",
                             where, 100 * (1 - share), paper.timeouts, erdos.timeouts)});
}

void against_oracle(const std::string& where, const SystemRow& ours, const SystemRow& oracle,
                    Findings& out) {
  const auto rounds = static_cast<double>(ours.rounds);
  const double bound = kOracleFactor * timeouts_of(oracle) + kOracleSlack * rounds / 300;
  out.push_back(judged(timeouts_of(ours) <= bound,
                       fmt::format("{}: {} timeouts of ours against the oracle's {}; the aim is at "
                                   "most {:.0f}.",
                                   where, ours.timeouts, oracle.timeouts, bound)));
  const double share = ours.quality / oracle.quality;
  out.push_back(judged(share >= kOracleQuality,
                       fmt::format("{}: ours gets {:.1f} % of the oracle's quality; the aim is "
                                   "{:.0f} %.",
                                   where, 100 * share, 100 * kOracleQuality)));
}

// Whether the paper's table comes out under the law that was fitted to it.
void as_in_paper(const std::string& where, const SystemRow& paper, const SystemRow& erdos,
                 Findings& out) {
  const double share = timeouts_of(erdos) / static_cast<double>(erdos.rounds);
  out.push_back(judged(share >= kErdosMisses[0] && share <= kErdosMisses[1],
                       fmt::format("{}: erdos_like misses {:.1f} % of the rounds; the paper has "
                                   "50.7 %.",
                                   where, 100 * share)));
  if (erdos.timeouts == 0) return;
  const double fewer = 1 - timeouts_of(paper) / timeouts_of(erdos);
  out.push_back(judged(fewer >= kPaperFewer,
                       fmt::format("{}: the paper's guard has {:.1f} % fewer timeouts than "
                                   "erdos_like ({} against {}); the paper measured 94.7 %.",
                                   where, 100 * fewer, paper.timeouts, erdos.timeouts)));
  if (!paper.ap || !erdos.ap || *erdos.ap <= 0) return;
  const double lost = 1 - *paper.ap / *erdos.ap;
  out.push_back(judged(lost >= kPaperApLost[0] && lost <= kPaperApLost[1],
                       fmt::format("{}: the paper's guard loses {:.1f} % of AP over rounds on time "
                                   "against erdos_like; the paper measured 7.1 %.",
                                   where, 100 * lost)));
}

// Where some delays are longer than any policy can make up for, the oracle says little: it sends
// each round as if it knew its delay. Judged is what can be expected.
void against_player(const std::string& where, const SystemRow& ours, const SystemRow& player,
                    Findings& out) {
  const auto worth = [](const SystemRow& r) {
    return r.quality - eval::kMissPrice * r.timeouts_share;
  };
  const double share = worth(ours) / worth(player);
  out.push_back(
      judged(share >= kPlayerShare,
             fmt::format("{}: quality less {} a miss of ours is {:.4f}, {:.1f} % of what "
                         "the player who knows the law gets ({:.4f}); the aim is {:.0f} %.",
                         where, eval::kMissPrice, worth(ours), 100 * share, worth(player),
                         100 * kPlayerShare)));
}

// "b0 (0.35), duplicate (0.36)".
void add_to(std::string& list, const std::string& name, const std::string& figure) {
  list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", name, figure);
}

// Which baselines of a table are as good as ours, or better: names with their figures.
struct Rivals {
  // No less of what the application really got, or nearly as much.
  std::string better;
  std::string close;
  // Fewer timeouts, or as many as far as the rounds can tell.
  std::string fewer;
  std::string near;
};

// `worth`: what the application really got.
Rivals rivals_of(const std::vector<SystemRow>& rows, const SystemRow& ours,
                 std::optional<double> (*worth)(const SystemRow&)) {
  Rivals out;
  const double mine = *worth(ours);
  for (const SystemRow& other : rows) {
    const std::optional<double> theirs = worth(other);
    if (!other.baseline || !theirs) continue;
    const std::string figure = fmt::format("{:.4f}", *theirs);
    if (*theirs >= mine) {
      add_to(out.better, other.name, figure);
    } else if (*theirs >= (1 - kClose) * mine) {
      add_to(out.close, other.name, figure);
    }
    const std::string timeouts = fmt::format("{}", other.timeouts);
    if (other.timeouts_ci95[1] < ours.timeouts_ci95[0]) {
      add_to(out.fewer, other.name, timeouts);
    } else if (other.timeouts_ci95[0] <= ours.timeouts_ci95[1]) {
      add_to(out.near, other.name, timeouts);
    }
  }
  return out;
}

// What the application really got: with recordings by AP, with sweeps by agreement.
struct Metric {
  const char* spoken;
  std::optional<double> (*worth)(const SystemRow& row);
};

Metric metric_of(const SystemRow& ours) {
  if (ours.agreement && ours.agreement->effective) {
    return {"effective agreement",
            [](const SystemRow& r) { return r.agreement ? r.agreement->effective : std::nullopt; }};
  }
  if (ours.effective_ap) {
    return {"effective AP", [](const SystemRow& r) { return r.effective_ap; }};
  }
  return {"quality", [](const SystemRow& r) { return std::optional(r.quality); }};
}

void against_others(const std::string& where, const std::vector<SystemRow>& rows,
                    const SystemRow& ours, Findings& out) {
  const auto [spoken, worth] = metric_of(ours);
  const double mine = *worth(ours);
  const Rivals rivals = rivals_of(rows, ours, worth);
  out.push_back(judged(rivals.better.empty(),
                       rivals.better.empty()
                           ? fmt::format("{}: ours has more {} than every baseline.", where, spoken)
                           : fmt::format("{}: with no less {} than ours ({:.4f}): {}.", where,
                                         spoken, mine, rivals.better)));
  if (!rivals.close.empty()) {
    out.push_back({Finding::Kind::kNotice,
                   fmt::format("{}: less {} than ours ({:.4f}), but within {:.0f} %: {}.", where,
                               spoken, mine, 100 * kClose, rivals.close)});
  }
  if (!rivals.fewer.empty()) {
    out.push_back(
        {Finding::Kind::kMissed, fmt::format("{}: with fewer timeouts than ours ({}): {}.", where,
                                             ours.timeouts, rivals.fewer)});
  }
  if (!rivals.near.empty()) {
    out.push_back(
        {Finding::Kind::kNotice,
         fmt::format("{}: these rounds cannot tell the timeouts of ours ({}) from those of "
                     "{}: the 95 % intervals overlap.",
                     where, ours.timeouts, rivals.near)});
  }
}

// By which parts undisturbed rounds of the testbed differ from the simulation's; empty when that is
// not known.
std::string parts_of(const AgreementRow& r) {
  if (!r.uplink_ms.testbed || !r.uplink_ms.sim) return "";
  const auto by = [](const Sides& s) { return *s.testbed - *s.sim; };
  return fmt::format(
      " Undisturbed rounds differ by {:+.1f} ms in the uplink, {:+.1f} ms from the hand-over to "
      "the "
      "computation's end, {:+.1f} ms in the downlink.",
      by(r.uplink_ms), by(r.compute_ms), by(r.downlink_ms));
}

// Whether the simulation tells what happens for real.
void of_agreement(const std::vector<AgreementRow>& rows, Findings& out) {
  for (const AgreementRow& r : rows) {
    out.push_back(judged(
        r.on_time_agrees,
        fmt::format("Testbed and simulation, {}: {:.1f} % and {:.1f} % on time ({:+.1f} points); "
                    "the aim is {:.0f} points.{}",
                    r.name, 100 * r.on_time.testbed, 100 * r.on_time.sim, 100 * r.on_time.points,
                    100 * r.points_aim,
                    r.on_time_agrees
                        ? ""
                        : " The simulation knows the median and 95th percentile of run times, "
                          "not the bursts of a busy machine.")));
    out.push_back(judged(r.e2e_agrees,
                         fmt::format("Testbed and simulation, {}: e2e p50 {:.1f} and {:.1f} ms "
                                     "({:+.1f} %); the aim is 5 %.{}",
                                     r.name, r.e2e_p50_ms.testbed, r.e2e_p50_ms.sim,
                                     100 * r.e2e_p50_ms.change, r.e2e_agrees ? "" : parts_of(r))));
    if (!r.uplink_agrees) continue;
    out.push_back(
        judged(*r.uplink_agrees,
               fmt::format("Testbed and simulation, {}: the undisturbed uplink takes {:.1f} and "
                           "{:.1f} ms; the aim is 1.5 ms.",
                           r.name, *r.uplink_ms.testbed, *r.uplink_ms.sim)));
  }
}

}  // namespace

void of_erdos(const Document& document, Findings& out) {
  for (const Table& table : document.tables) {
    if (const auto* agreement = std::get_if<std::vector<AgreementRow>>(&table.rows)) {
      of_agreement(*agreement, out);
    }
    const auto* rows = std::get_if<std::vector<SystemRow>>(&table.rows);
    const SystemRow* ours = rows == nullptr ? nullptr : find(*rows, kOurs);
    if (ours == nullptr) continue;
    const SystemRow* erdos = find(*rows, "erdos_like");
    const SystemRow* oracle = find(*rows, "oracle");
    // The law that is calibrated to the paper's figures.
    const bool as_in_the_paper = table.name == "uniform";
    if (erdos != nullptr && as_in_the_paper) {
      against_erdos(table.title, *ours, *erdos, out);
      if (const SystemRow* paper = find(*rows, "paper")) of_paper(table.title, *paper, *erdos, out);
    }
    const SystemRow* player = find(*rows, "causal_player");
    const bool is_fitted = table.name == "per-nic";
    const bool is_heavy_tailed = table.name.starts_with("exponential");
    if (is_fitted && erdos != nullptr) {
      if (const SystemRow* paper = find(*rows, "paper")) {
        as_in_paper(table.title, *paper, *erdos, out);
      }
    }
    if (is_heavy_tailed && player != nullptr) {
      against_player(table.title, *ours, *player, out);
    } else if (oracle != nullptr) {
      against_oracle(table.title, *ours, *oracle, out);
    }
    if (oracle != nullptr && (as_in_the_paper || is_fitted)) {
      const double share = timeouts_of(*oracle) / static_cast<double>(oracle->rounds);
      out.push_back(judged(share <= kOracleMayMiss,
                           fmt::format("{}: the oracle misses {:.2f} % of the rounds; the law is "
                                       "fair up to {:.1f} %.",
                                       table.title, 100 * share, 100 * kOracleMayMiss)));
    }
    against_others(table.title, *rows, *ours, out);
  }
}

void of_lidar(const Document& document, Findings& out) {
  for (const Table& table : document.tables) {
    const auto& rows = rows_as<SystemRow>(table);
    const SystemRow* ours = find(rows, kOurs);
    const SystemRow* oracle = find(rows, "oracle");
    if (ours == nullptr) continue;
    if (oracle != nullptr) against_oracle(table.title, *ours, *oracle, out);
    if (const SystemRow* player = find(rows, "causal_player")) {
      against_player(table.title, *ours, *player, out);
    }
    against_others(table.title, rows, *ours, out);
  }
}

// One sentence per severity, and one per deadline at which a baseline is ahead.
void of_sweep(const Document& document, Findings& out) {
  for (const Table& table : document.tables) {
    // Ours and the best baseline, by deadline.
    std::map<int, std::pair<const SystemRow*, const SystemRow*>> best;
    for (const SystemRow& r : rows_as<SystemRow>(table)) {
      auto& [mine, theirs] = best[r.sweep.value().deadline_ms];
      if (r.name == kOurs) mine = &r;
      if (!r.baseline) continue;
      if (theirs == nullptr || r.quality > theirs->quality) theirs = &r;
    }
    std::size_t ahead = 0;
    for (const auto& [deadline, rows] : best) {
      const auto& [mine, theirs] = rows;
      if (mine == nullptr || theirs == nullptr) continue;
      if (mine->quality > theirs->quality) {
        ++ahead;
        continue;
      }
      out.push_back(
          {Finding::Kind::kNotice,
           fmt::format("{}, {} ms: {} has no less quality than ours ({:.4f} against "
                       "{:.4f}).",
                       table.title, deadline, theirs->name, theirs->quality, mine->quality)});
    }
    out.push_back({Finding::Kind::kNotice,
                   fmt::format("{}: ours has more quality than every baseline at {} of {} "
                               "deadlines.",
                               table.title, ahead, best.size())});
  }
}

namespace {

// Which side of 0 an interval lies on: -1, 0 (it holds 0, or there is none), 1.
int side(const eval::Paired& paired) {
  if (!paired.ci95) return 0;
  return (*paired.ci95)[0] > 0 ? 1 : (*paired.ci95)[1] < 0 ? -1 : 0;
}

}  // namespace

void of_ladder(const Document& document, Findings& out) {
  for (const Table& table : document.tables) {
    // Baselines, and forms of ours, with more quality.
    std::string better;
    std::string worthier;
    std::string fewer;
    std::string near;
    for (const LadderRow& r : rows_as<LadderRow>(table)) {
      if (r.name == kOurs) continue;
      const int quality = side(r.more_quality);
      const int timeouts = side(r.more_timeouts_per_300);
      const std::string figure = fmt::format("{:+.4f}", r.more_quality.mean);
      if (quality > 0) add_to(r.baseline ? better : worthier, r.name, figure);
      if (timeouts < 0) add_to(fewer, r.name, fmt::format("{:+.2f}", r.more_timeouts_per_300.mean));
      if (quality == 0 && timeouts == 0) add_to(near, r.name, figure);
    }
    const auto say = [&](bool missed, const char* what, const std::string& list) {
      if (list.empty()) return;
      out.push_back({missed ? Finding::Kind::kMissed : Finding::Kind::kNotice,
                     fmt::format("{}: {}: {}.", table.title, what, list)});
    };
    say(true, "baselines with more quality than ours", better);
    say(false, "forms of ours with more quality", worthier);
    say(false, "with fewer timeouts of 300 than ours", fewer);
    say(false, "within noise of ours, in timeouts and quality", near);
    if (better.empty()) {
      out.push_back(
          judged(true, fmt::format("{}: no baseline has more quality than ours.", table.title)));
    }
  }
}

void of_handler(const Document& document, Findings& out) {
  for (const Table& table : document.tables) {
    for (const SystemRow& r : rows_as<SystemRow>(table)) {
      if (!r.handler || !r.handler->consecutive_change) continue;
      const double change = *r.handler->consecutive_change;
      out.push_back(
          judged(change <= -kFewerInARow,
                 fmt::format(
                     "{}: {} misses {:+.1f} % rounds right after a miss, against the paper's guard "
                     "without its handler; the aim, and the paper's figure, is {:+.0f} %.",
                     table.title, r.name, 100 * change, -100 * kFewerInARow)));
    }
  }
}

}  // namespace interneuron::experiments
