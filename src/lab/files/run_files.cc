#include "lab/files/run_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/base/statistics.h"
#include "host/process/failure.h"

namespace interneuron::lab {
namespace {

double rounded(double v) { return std::round(v * 1000.0) / 1000.0; }

Json quantiles(const std::vector<double>& values) {
  return {{"p50", rounded(percentile(values, 0.50))},
          {"p95", rounded(percentile(values, 0.95))},
          {"p99", rounded(percentile(values, 0.99))},
          {"mean", rounded(mean(values))}};
}

Json count_levels(const std::vector<RoundRow>& rows, const RunInfo& info) {
  std::map<int, std::uint32_t> counts;
  for (const RoundRow& r : rows) {
    if (r.road) ++counts[r.road->level];
  }
  Json out = Json::array();
  for (const auto& [level, rounds] : counts) {
    const auto i = static_cast<std::size_t>(level);
    out.push_back({{"level", level},
                   {"name", i < info.level_names.size() ? info.level_names[i] : ""},
                   {"rounds", rounds}});
  }
  return out;
}

Json count_by(const std::vector<RoundRow>& rows, const std::string& none,
              std::string (*key)(const RoundRow&)) {
  std::map<std::string, std::uint32_t> counts;
  for (const RoundRow& r : rows) {
    const std::string k = key(r);
    ++counts[k.empty() ? none : k];
  }
  Json out = Json::object();
  for (const auto& [name, rounds] : counts) out[name] = rounds;
  return out;
}

}  // namespace

Json summarise(const std::vector<RoundRow>& rows, const RunInfo& info) {
  std::vector<double> on_time_ms;
  std::vector<double> all_ms;
  std::uint32_t answers = 0;
  std::uint32_t on_time = 0;
  std::uint32_t stale = 0;
  std::uint32_t possible = 0;
  bool judged = !rows.empty();
  for (const RoundRow& r : rows) {
    if (!r.answered) continue;
    ++answers;
    // Rounded as in rounds.csv, so that both agree to the last digit.
    const double e2e = rounded(to_ms(r.e2e));
    all_ms.push_back(e2e);
    if (r.outcome == Outcome::kRemote) {
      ++on_time;
      on_time_ms.push_back(e2e);
    } else if (!r.age_rounds || *r.age_rounds > 0) {
      ++stale;
    }
    judged = judged && r.possible.has_value();
    if (r.possible.value_or(false)) ++possible;
  }
  Json s;
  s["schema"] = "interneuron.run/1";
  s["seed"] = info.seeded ? Json(info.seed) : Json(nullptr);
  s["profiles"] = info.profiles;
  s["policy"] = info.policy;
  s["guard"] = info.guard;
  s["deadline_ms"] = to_ms(info.deadline);
  s["period_ms"] = to_ms(info.period);
  s["ladder"] = info.ladder;
  s["backup"] = info.backup;
  s["rounds"] = rows.size();
  s["answers"] = answers;
  s["on_time"] = on_time;
  s["local"] = answers - on_time;
  s["local_not_fresh"] = stale;
  s["timeouts"] = rows.size() - on_time;
  s["refused"] = std::ranges::count(rows, kRefusedPlan, &RoundRow::plan);
  s["best_possible"] = judged ? Json(possible) : Json(nullptr);
  s["e2e_ms"] = quantiles(on_time_ms);
  s["e2e_all_ms"] = quantiles(all_ms);
  const auto known = [](const std::optional<double>& value) {
    return value ? Json(rounded(*value)) : Json(nullptr);
  };
  s["ap"] = known(info.ap);
  s["ap50"] = known(info.ap50);
  s["ar"] = known(info.ar);
  s["drawn_precision"] = known(info.drawn_precision);
  s["drawn_recall"] = known(info.drawn_recall);
  s["levels"] = count_levels(rows, info);
  s["used"] = count_by(rows, "local", [](const RoundRow& r) -> std::string {
    if (!r.road) return "";
    return r.road->variant == 0 ? "raw" : "sampled";
  });
  s["plans"] = count_by(rows, "nothing", [](const RoundRow& r) { return r.plan; });
  s["bytes"] = Json::object();
  for (const LinkUse& link : info.links) {
    s["bytes"][link.name] = {{"sent", link.sent_bytes},
                             {"received", link.received_bytes},
                             {"fragments_resent", link.resent_fragments},
                             {"symbols_sent", link.sent_symbols},
                             {"packets_lost", link.lost_packets}};
  }
  return s;
}

void print_table(const Json& s) {
  const auto rounds = s["rounds"].get<double>();
  const auto share = [rounds](const Json& n) {
    return rounds > 0 ? 100.0 * n.get<double>() / rounds : 0.0;
  };
  fmt::print("\n{:<28}{:>10}\n", "rounds", s["rounds"].get<std::size_t>());
  const auto row = [&](const char* name, const char* key) {
    fmt::print("{:<28}{:>10}{:>9.1f} %\n", name, s[key].get<std::size_t>(), share(s[key]));
  };
  row("answers", "answers");
  row("  on time (remote)", "on_time");
  row("  answered locally", "local");
  row("timeouts", "timeouts");
  if (s["refused"] != 0) row("  refused by the policy", "refused");
  if (!s["best_possible"].is_null()) row("best possible (clairvoyant)", "best_possible");
  fmt::print("{:<28}{:>10}{:>10}{:>10}{:>10}\n", "e2e, ms", "p50", "p95", "p99", "mean");
  const auto times = [&](const char* name, const Json& q) {
    fmt::print("{:<28}{:>10.1f}{:>10.1f}{:>10.1f}{:>10.1f}\n", name, q["p50"].get<double>(),
               q["p95"].get<double>(), q["p99"].get<double>(), q["mean"].get<double>());
  };
  times("  rounds on time", s["e2e_ms"]);
  times("  all rounds", s["e2e_all_ms"]);
  if (s["ap"].is_null()) {
    fmt::print("{:<28}no ground truth\n", "AP, AR");
  } else {
    fmt::print("{:<28}AP {:.3f}   AP50 {:.3f}   AR {:.3f}   (of every answer, local ones too)\n",
               "accuracy", s["ap"].get<double>(), s["ap50"].get<double>(), s["ar"].get<double>());
  }
  fmt::print("{:<28}{}, {}\n", "guard, policy", s["guard"].get<std::string>(),
             s["policy"].get<std::string>());
  if (!s["ladder"].get<std::string>().empty()) {
    // Without the levels, which follow with what each was used for.
    const std::string ladder = s["ladder"];
    fmt::print("{:<28}{}\n", "detectors", ladder.substr(0, ladder.find(": L0")));
  }
  fmt::print("quality levels used at the roadside\n");
  for (const Json& level : s["levels"]) {
    fmt::print("  {:<26}{:>10}\n",
               fmt::format("{} {}", level["level"].get<int>(), level["name"].get<std::string>()),
               level["rounds"].get<std::size_t>());
  }
  fmt::print("image used\n");
  for (const auto& [name, count] : s["used"].items()) {
    fmt::print("  {:<26}{:>10}\n", name, count.get<std::size_t>());
  }
  fmt::print("links that frames went over\n");
  for (const auto& [plan, count] : s["plans"].items()) {
    fmt::print("  {:<26}{:>10}\n", plan, count.get<std::size_t>());
  }
  fmt::print("{:<28}{:>10}{:>12}{:>10}{:>10}{:>10}\n", "link", "sent MB", "received MB", "resent",
             "symbols", "lost");
  for (const auto& [name, link] : s["bytes"].items()) {
    fmt::print("  {:<26}{:>10.2f}{:>12.2f}{:>10}{:>10}{:>10}\n", name,
               link["sent"].get<double>() / 1e6, link["received"].get<double>() / 1e6,
               link["fragments_resent"].get<std::size_t>(), link["symbols_sent"].get<std::size_t>(),
               link["packets_lost"].get<std::size_t>());
  }
}

void make_directory(const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) {
    throw cli::Failure(cli::kFailed, "output folder '" + directory.string() +
                                         "': " + error.message() + "; give another with --out DIR");
  }
}

}  // namespace interneuron::lab
