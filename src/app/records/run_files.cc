#include "app/records/run_files.h"

#include <fmt/format.h>

#include "app/process/failure.h"

namespace interneuron::records {
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
  fmt::print("{:<28}{}, {}, {}\n", "guard, policy, images", s["guard"].get<std::string>(),
             s["policy"].get<std::string>(), s["images"].get<std::string>());
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
    throw process::Failure(process::kFailed, "output folder '" + directory.string() + "': " +
                                                 error.message() + "; give another with --out DIR");
  }
}

}  // namespace interneuron::records
